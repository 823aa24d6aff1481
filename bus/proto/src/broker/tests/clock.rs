//! The community's time, driven by a client.

use super::*;

#[test]
fn one_client_drives_the_clock_and_everybody_is_told() {
    let b = &mut broker();
    let (driver, mut a, mut c) = (Speaker::new(b, 0.0, "driver"), Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    let settings = [1.0, 2.0, 0.0].map(|rate| Some(ClockSetting { at: 10.0, time: 500.0, rate }));
    settings.iter().for_each(|setting| driver.drive(b, 10.0, *setting));
    assert_eq!(a.told(b, 10.0), [settings[2]], "only the last setting counts");
    driver.drive(b, 11.0, settings[1]);
    c.drive(b, 12.0, settings[0]);
    assert_eq!(c.hear(b, 12.0).2, ["driver drives the community's time already: end that first"]);
    assert_eq!(c.clock, [settings[1]], "whoever may not drive is told what time it is");
    assert_eq!(b.clock_setting(), settings[1]);
    c.drive(b, 12.0, None);
    assert_eq!(b.clock_setting(), settings[1], "and cannot end it");
    let mut late = Speaker::new(b, 12.0, "late");
    late.register(b, 12.0, "DB_TIME", "*", 0.0);
    b.tick(12.0);
    let (heard, ..) = late.hear(b, 12.0);
    assert_eq!(heard.last().map(|h| &h.value[..]), Some(&504.0_f64.to_le_bytes()[..]));
    driver.drive(b, 13.0, None);
    assert_eq!((a.told(b, 13.0), b.clock_setting()), (vec![None], None));
    c.drive(b, 14.0, settings[0]);
    assert_eq!((a.told(b, 14.0), b.clock_setting()), (vec![settings[0]], settings[0]), "then another may");
    b.disconnect(15.0, c.id, 0, false);
    assert_eq!((a.told(b, 15.0), b.clock_setting()), (vec![None], None), "time does not stay with the dead");
}

#[test]
fn a_clock_that_jumps_makes_nobody_wait_and_nobody_forgotten() {
    let b = &mut broker();
    let (driver, mut a, mut c) = (Speaker::new(b, 0.0, "driver"), Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "c"));
    let leased = Introduction { lease_secs: 10.0, ..Introduction::new("leased") };
    let leased = b.connect(0.0, &leased).unwrap();
    b.disconnect(0.0, leased, 0, false);
    c.register(b, 0.0, "X", "*", 0.5);
    a.text(b, 1.0, "X", "1");
    a.text(b, 1.1, "X", "2");
    for time in [1e9, -1e9] {
        driver.drive(b, 1.2, Some(ClockSetting { at: 1.2, time, rate: 0.0 }));
        b.tick(1.2);
        assert!(b.is_expected("leased"));
        assert!(!b.holds_back(1.2, a.id));
    }
    assert_eq!(c.texts(b, 1.2), ["1"]);
    b.tick(1.5);
    assert_eq!(c.texts(b, 1.5), ["2"]);
    b.tick(10.0);
    assert!(!b.is_expected("leased"));
}

#[test]
fn after_a_brokers_death_the_clock_is_as_it_was_until_it_is_clear_that_nobody_drives() {
    let setting = Some(ClockSetting { at: 1.0, time: 500.0, rate: 1.0 });
    for comes_back in [true, false] {
        let b = &mut Broker::recover(BrokerConfig::new("test"), 0.0, [], 10.0);
        let (mut a, driver) = (Speaker::new(b, 0.0, "a"), Speaker::new(b, 0.0, "driver"));
        b.tick(9.0);
        assert_eq!(a.told(b, 9.0), []);
        if comes_back {
            driver.drive(b, 9.0, setting);
            assert_eq!(a.told(b, 9.0), [setting]);
        }
        assert!(b.next_deadline() <= 10.0);
        b.tick(10.0);
        assert_eq!(a.told(b, 10.0), if comes_back { vec![] } else { vec![None] });
    }
}
