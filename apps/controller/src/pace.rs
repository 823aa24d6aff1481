//! How long a robot is on its way: a simulated camera jumps, and a person who watches wants to see a robot.

use elk_geometry::Pose;
use elk_spatial::messages::PoseCommand;

/// A robot's speed, and how many times as fast it is to go.
#[derive(Debug, Clone, Default)]
pub struct Pace {
    /// Along the way (m/s).
    pub speed: f64,
    /// On the spot (rad/s).
    pub turn_rate: f64,
    /// Times as fast as that; 0: at once.
    pub factor: f64,
    /// Where the robot was last seen.
    from: Option<Pose>,
    /// The command that it is under way for, and when it will be there (s).
    under_way: Option<(u64, f64)>,
}

impl Pace {
    /// A robot with this speed (m/s) and turn rate (rad/s), `factor` times as fast.
    pub fn new(speed: f64, turn_rate: f64, factor: f64) -> Self {
        Self { speed, turn_rate, factor, ..Self::default() }
    }

    /// Whether the robot takes any time at all.
    pub fn is_slow(&self) -> bool {
        self.factor > 0.0
    }

    /// The robot has been seen.
    pub fn is_at(&mut self, pose: &Pose) {
        self.from = Some(*pose);
    }

    /// Whether, at `now` (s), the robot would be where the command sends it: it sets out when this is first asked.
    pub fn is_there(&mut self, command: &PoseCommand, now: f64) -> bool {
        if !self.is_slow() {
            return true;
        }
        let arrival = match self.under_way {
            Some((id, arrival)) if id == command.id => arrival,
            _ => now + self.secs(command),
        };
        self.under_way = Some((command.id, arrival));
        now >= arrival
    }

    /// How long the way takes: it turns while it goes.
    fn secs(&self, command: &PoseCommand) -> f64 {
        let Some(from) = &self.from else { return 0.0 };
        let mut length = 0.0;
        let mut last = from.position();
        for next in command.via.iter().copied().chain([command.pose.position()]) {
            length += (next - last).norm();
            last = next;
        }
        let angle = from.0.rotation.angle_to(&command.pose.0.rotation);
        (length / self.speed).max(angle / self.turn_rate) / self.factor
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Point3;

    use super::*;

    fn command(id: u64, via: &[[f64; 3]], to: [f64; 3], yaw: f64) -> PoseCommand {
        let via = via.iter().copied().map(Point3::from).collect();
        PoseCommand { id, via, pose: Pose::from_yaw_pitch(to.into(), yaw, 0.0) }
    }

    #[test]
    fn a_way_takes_as_long_as_a_robot_needs_for_it() {
        let mut pace = Pace::new(0.5, PI, 2.0);
        pace.is_at(&Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0));
        // 3 m at 1 m/s.
        let round_the_corner = command(1, &[[2.0, 0.0, 0.0]], [2.0, 1.0, 0.0], 0.0);
        assert!(!pace.is_there(&round_the_corner, 10.0));
        assert!(!pace.is_there(&round_the_corner, 12.9));
        assert!(pace.is_there(&round_the_corner, 13.0));
        // Half a turn at a turn a second.
        pace.is_at(&round_the_corner.pose);
        let about_turn = command(2, &[], [2.0, 1.0, 0.0], PI);
        assert!(!pace.is_there(&about_turn, 13.1));
        assert!(pace.is_there(&about_turn, 13.7));
    }

    #[test]
    fn without_a_pace_it_is_there_at_once() {
        let mut pace = Pace::new(0.5, PI, 0.0);
        pace.is_at(&Pose::from_yaw_pitch(Point3::origin(), 0.0, 0.0));
        assert!(pace.is_there(&command(1, &[], [1000.0, 0.0, 0.0], 0.0), 0.0));
        let mut unseen = Pace::new(0.5, PI, 1.0);
        assert!(unseen.is_there(&command(1, &[], [1.0, 0.0, 0.0], 0.0), 0.0), "nobody knows where from");
    }
}
