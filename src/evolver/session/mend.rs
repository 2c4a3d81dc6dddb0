//! Commands that remove or divide elements that are too short, too small or too narrow.

use super::{Host, Session, motion::Done};
use crate::evolver::{
    datafile::Representation,
    surface::{EdgeId, FacetId},
};

impl Session {
    pub(super) fn remove_short(&mut self, value: f64, host: &mut dyn Host) -> Done {
        let mut count = 0;
        let mut tried = 0;
        while let Some(edge) = self
            .surface
            .edges
            .ids()
            .filter(|&id| self.surface.edge_length(id) < value && !self.surface.edges[id].common.fixed)
            .nth(tried)
        {
            self.spend()?;
            if self.surface.collapse(edge).is_some() {
                count += 1;
            } else {
                tried += 1;
            }
        }
        self.changed();
        self.say(host, &format!("Edges deleted: {count}\n"));
        Ok(())
    }

    pub(super) fn remove_small(&mut self, value: f64, host: &mut dyn Host) -> Done {
        let mut count = 0;
        let mut tried = 0;
        while let Some(facet) = self
            .surface
            .facets
            .ids()
            .filter(|&id| self.has_films() && self.surface.facet_area(id) < value)
            .nth(tried)
        {
            self.spend()?;
            let shortest = self.surface.facets[facet]
                .edges
                .iter()
                .map(|d| d.edge)
                .min_by(|a, b| self.surface.edge_length(*a).total_cmp(&self.surface.edge_length(*b)));
            if shortest.is_some_and(|edge| self.surface.collapse(edge).is_some()) {
                count += 1;
            } else {
                tried += 1;
            }
        }
        self.changed();
        self.say(host, &format!("Facets deleted: {count}\n"));
        Ok(())
    }

    /// `K`: divides the longest edge of facets with an angle below `value`.
    pub(super) fn divide_skinny(&mut self, value: f64, host: &mut dyn Host) -> Done {
        if self.surface.representation == Representation::String {
            return Ok(());
        }
        let skinny = |id: FacetId| {
            let mut sides: Vec<(f64, EdgeId)> = self.surface.facets[id]
                .edges
                .iter()
                .map(|d| (self.surface.edge_length(d.edge), d.edge))
                .collect();
            sides.sort_by(|a, b| a.0.total_cmp(&b.0));
            let [(a, _), (b, _), (c, longest)] = sides[..] else { return None };
            let cosine = (b * b + c * c - a * a) / (2.0 * b * c);
            (cosine.clamp(-1.0, 1.0).acos() < value).then_some(longest)
        };
        let mut long: Vec<EdgeId> = self.surface.facets.ids().filter_map(skinny).collect();
        long.sort_unstable();
        long.dedup();
        self.refine_edges(&long);
        self.changed();
        self.say(host, &format!("Edges divided: {}\n", long.len()));
        Ok(())
    }
}
