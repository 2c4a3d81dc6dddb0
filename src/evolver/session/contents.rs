//! Contents along edges or on the walls themselves, and volumes held against those of the closed bodies.
//!
//! Surface Evolver integrates a content along the chords of a contact line. That is sound where the integrand nearly vanishes;
//! far from there what lies between chords and wall is worth more than the films that it costs, and a bubble is drawn into
//! volume that it does not hold. Then, from that moment on, the slivers count.

use super::{Session, format::significant, motion::Done};
use crate::{
    evolver::{
        datafile::Model,
        error::EvolverError,
        physics::{FunctionalId, closed::closed_volumes},
        surface::BodyId,
    },
    index::Id,
};
use glam::DVec3;
use std::fmt::Write as _;

/// Along what contents are integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Contents {
    /// Along the edges as they are, as in Surface Evolver; on the walls as soon as that would draw the surface away.
    Chords,
    /// Along the edges whatever comes of it.
    AlwaysChords,
    /// On the walls.
    OnWalls,
}

/// What the slivers between a contact line and its wall may be worth, in films that would fill them, before they count. The
/// paper's bubbles, which lie within their own size of the place where their integrand vanishes, come to 0.3 to 1.1; at 2.3 the
/// bubble of the torus, in 64 linear facets, has gained a hundredth of its volume, and at 3.7 more than four.
const TEMPTING: f64 = 1.5;

/// By how much of a body's volume its integrals, slivers included, may differ from the closed body: quadrature on the coarsest
/// meshes, with edges as long as the bubble is wide, comes to a thousandth; a singularity or a cut to the volume itself.
const PARTED: f64 = 2e-3;

/// The same for integrals along chords: the coarsest contact lines in use cut off less than a percent.
const PARTED_CHORDS: f64 = 0.02;

/// What may lie between walls and edges that keep their chords, as a part of the volume, before it is said.
const KEPT: f64 = 1e-3;

impl Session {
    /// Takes contents along the edges' chords for good, as Surface Evolver does.
    pub fn keep_chords(&mut self) {
        self.contents = Contents::AlwaysChords;
        // What was said of the walls does not hold.
        self.told = super::routines::Told::default();
        self.problem = None;
    }

    /// Whether contents are taken on the walls themselves, since chords would draw the surface away.
    #[must_use]
    pub fn contents_on_walls(&self) -> bool {
        self.contents == Contents::OnWalls
    }

    /// Goes over to contents on the walls where chords would draw the surface away.
    pub(super) fn leave_chords(&mut self) -> Done {
        let Some(current) = self.problem.as_ref().filter(|_| self.contents == Contents::Chords) else {
            return Ok(());
        };
        let (problem, places) = (&current.problem, &current.state.places);
        if !problem.has_contents() {
            return Ok(());
        }
        let quadratic = self.surface.model == Model::Quadratic;
        let lines = problem.contact_lines(self.surface.bodies.len(), places);
        let gain = problem.temptation(places, &lines, &|body| self.size_of(body));
        let lost = lines.enumerated().find_map(|(id, line)| {
            let part = (line.cut / self.size_of(id)).abs();
            (part > line.mesh_error(quadratic)).then_some(part)
        });
        let reason = if gain > TEMPTING {
            let gain = significant(gain, 2);
            format!(
                "between its edges and the wall the contact line can gain volume that is worth {gain} times the film there"
            )
        } else if let Some(part) = lost {
            let part = significant(part, 2);
            format!("the contact line has left the wall between its vertices, by {part} of the volume")
        } else {
            return Ok(());
        };
        current.state.store(&mut self.surface);
        self.contents = Contents::OnWalls;
        self.problem = None;
        let _ = writeln!(
            self.told,
            "note: {reason}; from here on contents are taken on the walls, and films end there"
        );
        self.current().map(|_| ())
    }

    /// Says once where edges whose contents stay on their chords cut off more than such a mesh should.
    fn tell_kept_chords(&mut self) {
        let Some(current) = self.problem.as_ref().filter(|_| !self.told_kept_chords) else { return };
        let kept = current.problem.kept_volumes(self.surface.bodies.len(), &current.state.places);
        let worst = kept.enumerated().map(|(id, volume)| (volume / self.size_of(id), id));
        let Some((part, id)) = worst.filter(|(part, _)| part.is_finite()).max_by(|a, b| a.0.total_cmp(&b.0))
        else {
            return;
        };
        if part > KEPT {
            let (part, body) = (significant(part, 2), self.surface.bodies[id].id);
            let _ = writeln!(
                self.told,
                "note: edges on several or one-sided constraints, or at images of a torus, take their contents along chords, \
                 which leave out up to {part} of the volume of body {body}; refine"
            );
            self.told_kept_chords = true;
        }
    }

    /// The volume that a body shall have, or has.
    fn size_of(&self, id: BodyId) -> f64 {
        let has =
            self.problem.as_ref().map(|now| now.values.functionals[FunctionalId::from_index(id.index())]);
        self.surface.bodies[id].target.or(has).unwrap_or(0.0).abs()
    }

    /// Sees that the volumes by integrals are those of the closed bodies.
    ///
    /// # Errors
    /// [`EvolverError::Surface`] with both volumes of a body where they part, and the place.
    pub(super) fn compare_volumes(&mut self) -> Done {
        self.current()?;
        self.tell_kept_chords();
        let Some(current) = &self.problem else { return Ok(()) };
        let (problem, places) = (&current.problem, &current.state.places);
        if !problem.has_contents() {
            return Ok(());
        }
        let lines = problem.contact_lines(self.surface.bodies.len(), places);
        let closed = closed_volumes(problem, &self.surface, places);
        for (id, line) in lines.enumerated() {
            let Some(closed) = closed[id] else { continue };
            let body = &self.surface.bodies[id];
            let volume = current.values.functionals[FunctionalId::from_index(id.index())];
            let size = self.size_of(id);
            let missing = if self.contents_on_walls() { 0.0 } else { line.cut };
            let singular = (volume + missing + line.refined - closed).abs() > PARTED * size;
            if !singular && (volume - closed).abs() <= PARTED_CHORDS * size {
                continue;
            }
            let reason = if singular {
                let [x, y, z] = line.worst.to_array().map(|x| significant(x, 6));
                format!(
                    "The integrand meets its singularity or cut, next to ({x}, {y}, {z}); choose its origin away from the body"
                )
            } else {
                "The contact line has left its wall between vertices; refine, or choose the integrand's origin nearer to \
                 the body"
                    .to_owned()
            };
            return Err(EvolverError::Surface(format!(
                "body {}: the content integrals give the volume {}, but the body closed on its walls holds {}. {reason}",
                body.id,
                significant(volume, 10),
                significant(closed, 10),
            )));
        }
        Ok(())
    }

    /// After a motion: goes over to contents on the walls, and compares volumes, where contact lines have moved since this was
    /// done last.
    pub(super) fn look_at_contents(&mut self) -> Done {
        let Some(current) = self.problem.as_ref().filter(|current| current.problem.has_contents()) else {
            return Ok(());
        };
        let here = current.problem.contact_ends(&current.state.places);
        let edges: Vec<f64> = here.iter().map(|[a, b]| NEARBY_EDGES * a.distance(*b)).collect();
        if !has_moved(&self.looked_at, &here, |at| edges[at]) {
            return Ok(());
        }
        let size = here.iter().fold(0.0, |size: f64, [end, _]| size.max(end.distance(here[0][0])));
        let elsewhere = has_moved(&self.compared, &here, |_| NEARBY_LINE * size);
        current.state.store(&mut self.surface);
        self.leave_chords()?;
        if elsewhere {
            self.compare_volumes()?;
            self.compared.clone_from(&here);
        }
        self.looked_at = here;
        Ok(())
    }
}

/// How far the nodes of a contact line may move, as a part of its edges, before its slivers are looked at again, and as a part
/// of its size before volumes are compared again: both take longer than a Newton step.
const NEARBY_EDGES: f64 = 0.05;
const NEARBY_LINE: f64 = 0.05;

/// Whether a contact line, by the ends of its edges, has moved by more than `limit`, or is another one.
fn has_moved(before: &[[DVec3; 2]], now: &[[DVec3; 2]], limit: impl Fn(usize) -> f64) -> bool {
    let far = |(at, (old, new)): (usize, (&[DVec3; 2], &[DVec3; 2]))| {
        old.iter().zip(new).any(|(a, b)| a.distance(*b) > limit(at))
    };
    before.len() != now.len() || before.iter().zip(now).enumerate().any(far)
}
