//! A tree of straight ways within what the robot can get to, grown from where it is: RRT* (Karaman and Frazzoli, *Sampling-based
//! Algorithms for Optimal Motion Planning*, IJRR 2011), whose new branches reach for their sample as RRT-Connect's do (Kuffner and
//! LaValle, ICRA 2000).

use elk_geometry::Voxel;
use elk_geometry::ray::Traversal;
use elk_geometry::set::Near;
use nalgebra::Point3;

use crate::space::Space;

/// Less than this is no shorter (m).
const LEAST_M: f64 = 1e-9;

/// A place that a branch leads to.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// Where it is.
    pub voxel: Voxel,
    /// The middle of that; of the root, where the route starts (m, world).
    pub position: Point3<f64>,
    /// The node before it; of the root, itself.
    pub parent: usize,
    /// Length of the way to it along the tree (m).
    pub cost_m: f64,
}

/// The tree; its first node is the root.
pub struct Tree<'a> {
    space: &'a Space,
    reach: Near<'a>,
    nodes: Vec<Node>,
    /// Longest edge (m).
    edge_m: f64,
    /// Nodes at most.
    most: usize,
}

impl<'a> Tree<'a> {
    /// Only the root, at `from` (m, world) in the voxel in which the robot is. Edges are to be at most `edge_m` (m) long, nodes at
    /// most `most`.
    pub fn new(space: &'a Space, from: Point3<f64>, edge_m: f64, most: usize) -> Self {
        let root = Node { voxel: space.start(), position: from, parent: 0, cost_m: 0.0 };
        Self { space, reach: space.reach.near(), nodes: vec![root], edge_m, most }
    }

    /// The root first, and then as they came.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Whether it has all the nodes that it may have.
    pub fn is_full(&self) -> bool {
        self.nodes.len() >= self.most
    }

    /// Grows from the node that is nearest to voxel `sample` toward it, edge by edge, as far as the way is free.
    pub fn grow(&mut self, sample: Voxel) {
        let aim = self.space.center(sample);
        let away = |node: &Node| (node.position - aim).norm_squared();
        let nearest = self.nodes.iter().enumerate().min_by(|(_, one), (_, other)| away(one).total_cmp(&away(other)));
        let Some(mut last) = nearest.map(|(k, _)| k) else { return };
        while !self.is_full() && self.nodes[last].voxel != sample {
            let (from, way) = (self.nodes[last].position, aim - self.nodes[last].position);
            let length = way.norm();
            let voxel = match length <= self.edge_m {
                true => sample,
                false => Voxel::containing(from + way * (self.edge_m / length), self.space.resolution()),
            };
            // An edge shorter than a voxel gets nowhere.
            if voxel == self.nodes[last].voxel {
                return;
            }
            let Some(added) = self.add(voxel, last) else { return };
            last = added;
        }
    }

    /// A node in `voxel`, to which the way is free from node `from`: behind the node near it by which it is least far, and before
    /// those to which the way is shorter now. `None`: there is no free way, or there is one already.
    fn add(&mut self, voxel: Voxel, from: usize) -> Option<usize> {
        let position = self.space.center(voxel);
        if self.nodes.iter().any(|node| node.voxel == voxel) || !self.is_free(self.nodes[from].position, position) {
            return None;
        }
        let near: Vec<usize> = (0..self.nodes.len()).filter(|k| self.apart(*k, position) <= self.edge_m).collect();
        let by = |tree: &Self, k: usize| tree.nodes[k].cost_m + tree.apart(k, position);
        let (mut parent, mut cost_m) = (from, by(self, from));
        for &k in &near {
            let cost = by(self, k);
            if cost < cost_m - LEAST_M && self.is_free(self.nodes[k].position, position) {
                (parent, cost_m) = (k, cost);
            }
        }
        let added = self.nodes.len();
        self.nodes.push(Node { voxel, position, parent, cost_m });
        for k in near {
            let cost = cost_m + self.apart(k, position);
            if cost < self.nodes[k].cost_m - LEAST_M && self.is_free(position, self.nodes[k].position) {
                self.nodes[k].parent = added;
                self.shorten(k, self.nodes[k].cost_m - cost);
            }
        }
        Some(added)
    }

    /// How far a node is from a place (m).
    fn apart(&self, node: usize, position: Point3<f64>) -> f64 {
        (self.nodes[node].position - position).norm()
    }

    /// The way to a node is shorter by so much (m), and so are those to all behind it.
    fn shorten(&mut self, node: usize, by_m: f64) {
        let mut behind = vec![node];
        while let Some(node) = behind.pop() {
            self.nodes[node].cost_m -= by_m;
            behind.extend((1..self.nodes.len()).filter(|k| self.nodes[*k].parent == node));
        }
    }

    /// Whether the robot can go straight from one place to another.
    fn is_free(&mut self, from: Point3<f64>, to: Point3<f64>) -> bool {
        let reach = &mut self.reach;
        Traversal::new(from, to, self.space.resolution()).all(|voxel| reach.contains(voxel))
    }

    /// The nodes from the root, which is the first, to one.
    pub fn branch(&self, node: usize) -> Vec<usize> {
        let before = |node: &usize| Some(self.nodes[*node].parent).filter(|parent| parent != node);
        let mut branch: Vec<usize> = std::iter::successors(Some(node), before).collect();
        branch.reverse();
        branch
    }

    /// All nodes, each after the one before it in the tree.
    pub fn outward(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.nodes.len()).collect();
        order.sort_by(|one, other| self.nodes[*one].cost_m.total_cmp(&self.nodes[*other].cost_m).then(one.cmp(other)));
        order
    }
}

#[cfg(test)]
mod tests {
    use elk_geometry::astar;
    use elk_geometry::random::Random;

    use super::*;
    use crate::strategies::rooms::rooms;

    fn grown(space: &Space, edge_m: f64, most: usize) -> Tree<'_> {
        let mut tree = Tree::new(space, Point3::new(3.52, 0.57, 0.53), edge_m, most);
        let (mut random, all) = (Random::new(3, 1), space.reach.iter().collect::<Vec<_>>());
        let mut by_lot: Vec<Voxel> = all;
        by_lot.sort_unstable();
        for _ in 0..4 * most {
            tree.grow(by_lot[random.below(by_lot.len())]);
        }
        tree
    }

    #[test]
    fn it_stays_within_reach_and_its_costs_are_the_lengths_of_its_branches() {
        let space = rooms();
        let tree = grown(&space, 0.8, 300);
        assert_eq!(tree.nodes().len(), 300);
        for (k, node) in tree.nodes().iter().enumerate() {
            let branch = tree.branch(k);
            assert_eq!((branch[0], branch[branch.len() - 1]), (0, k));
            let mut length = 0.0;
            for edge in branch.windows(2) {
                let [from, to] = [edge[0], edge[1]].map(|k| tree.nodes()[k].position);
                assert!(Traversal::new(from, to, 0.1).all(|voxel| space.reach.contains(voxel)), "{from} to {to}");
                // To the middle of the voxel in which the edge ends.
                assert!((to - from).norm() < 0.8 + 0.1, "{from} to {to}");
                length += (to - from).norm();
            }
            assert!((node.cost_m - length).abs() < 1e-6, "{} for {length} m", node.cost_m);
        }
        let order = tree.outward();
        let place = |node: usize| order.iter().position(|k| *k == node);
        assert!((1..300).all(|k| place(tree.nodes()[k].parent) < place(k)));
    }

    #[test]
    fn it_leads_through_doors_nearly_by_the_shortest_way() {
        let space = rooms();
        let tree = grown(&space, 1.5, 600);
        let shortest = astar::all(&space.reach, space.start());
        let beyond: Vec<&Node> = tree.nodes().iter().filter(|node| node.voxel.y > 21).collect();
        assert!(beyond.len() > 100, "{}", beyond.len());
        let sum = |of: &dyn Fn(&Node) -> f64| beyond.iter().map(|node| of(node)).sum::<f64>();
        let (by_tree, by_voxels) = (sum(&|node| node.cost_m), sum(&|node| 0.1 * shortest.cost(node.voxel).unwrap()));
        // Straight lines cut what steps over voxels go round.
        assert!(by_tree < 1.1 * by_voxels, "{by_tree} for {by_voxels} m");
    }

    #[test]
    fn it_has_no_more_nodes_than_it_may_and_grows_into_no_wall() {
        let space = rooms();
        let mut tree = Tree::new(&space, space.center(space.start()), 0.5, 7);
        tree.grow(Voxel::new(35, 35, 5));
        assert!(!tree.is_full() && tree.nodes().iter().all(|node| node.voxel.y < 20), "the wall is in the way");
        tree.grow(Voxel::new(2, 5, 5));
        assert!(tree.is_full() && tree.nodes().len() == 7);
        tree.grow(Voxel::new(2, 15, 5));
        assert_eq!(tree.nodes().len(), 7);
    }
}
