//! The base: a plate with a groove for each shell, entrances into the gap, screw holes, and a window that saves plastic.

use super::{BuildError, design::Design, design::Fault, shells::Shell};
use crate::{
    mesh::{
        Sheet, VertexId, march,
        plate::{Plate, Pocket, Ring},
    },
    surface::LevelSet,
};
use glam::{DVec2, DVec3};
use std::{collections::BTreeMap, f64::consts::TAU};

/// How far the polygon of a round hole may leave the circle, in mm: below what a printer resolves.
const HOLE_SAGITTA: f64 = 0.02;

/// Samples per period of the middle sheet that the entrances are laid out on: its arcs are good to 0.1 % of their length.
const LAYOUT_SAMPLES: u32 = 64;

/// Plastic that must stay between a hole and a groove or an edge, in mm: three lines of a common nozzle.
const LEAST_LAND: f64 = 1.2;

/// Plastic that stays round the window, in mm: stiff enough to carry the shells.
const WINDOW_LAND: f64 = 8.0;

/// Windows of a smaller radius, in mm, save nothing worth a hole.
const LEAST_WINDOW: f64 = 8.0;

/// From the plate's edge to a screw hole's edge, in mm: room for the head.
const SCREW_EDGE: f64 = 3.5;

/// The base of a design, in mm: its upper face is the plane `z = thickness`, and x and y are those of the shells.
///
/// # Errors
/// [`BuildError`] if holes and grooves do not fit beside each other.
pub(super) fn base(design: &Design, shells: &[Shell; 2]) -> Result<Plate, BuildError> {
    let recipe = &design.recipe.base;
    let grooves: Vec<Pocket> = shells
        .iter()
        .map(|shell| Pocket { rings: groove_rings(design, shell), depth: recipe.groove })
        .collect();
    let size = design.region.size() * design.period.0;
    let (low, high) = (DVec2::splat(-recipe.margin), size.truncate() + recipe.margin);
    let outline = vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
    let entrances = entrances(design)?;
    let screws = screws(recipe.screws, recipe.screw_diameter, low, high);
    let plan = [
        ("base.entrance_diameter", recipe.entrance_diameter, &entrances),
        ("base.screw_diameter", recipe.screw_diameter, &screws),
    ];
    for (field, diameter, centres) in plan {
        for &centre in centres {
            has_room(field, centre, 0.5 * diameter, &grooves)?;
        }
    }
    holes_apart(&entrances, recipe.entrance_diameter, &screws, recipe.screw_diameter)?;
    let mut holes: Vec<Ring> = entrances
        .iter()
        .map(|&c| circle(c, 0.5 * recipe.entrance_diameter))
        .chain(screws.iter().map(|&c| circle(c, 0.5 * recipe.screw_diameter)))
        .collect();
    if recipe.window {
        let rings = grooves.iter().flat_map(|groove| &groove.rings).chain(&holes).chain([&outline]);
        let (centre, radius) = largest_circle(&rings.collect::<Vec<_>>(), low, high);
        if radius >= LEAST_WINDOW {
            holes.push(circle(centre, radius));
        }
    }
    Ok(Plate { outline, thickness: recipe.thickness, pockets: grooves, holes })
}

/// The centre and radius of the largest round window that leaves [`WINDOW_LAND`] to every ring: the best of a grid of places,
/// then a search with halving steps.
fn largest_circle(rings: &[&Ring], low: DVec2, high: DVec2) -> (DVec2, f64) {
    const PLACES: u32 = 24;
    let room = |p: DVec2| {
        rings.iter().map(|ring| distance_to_ring(ring, p)).fold(f64::INFINITY, f64::min) - WINDOW_LAND
    };
    let part = |i: u32| (f64::from(i) + 0.5) / f64::from(PLACES);
    let mut best = (0.5 * (low + high), f64::NEG_INFINITY);
    for (i, j) in (0..PLACES).flat_map(|i| (0..PLACES).map(move |j| (i, j))) {
        let p = low + (high - low) * DVec2::new(part(i), part(j));
        let radius = room(p);
        if radius > best.1 {
            best = (p, radius);
        }
    }
    let mut step = (high - low) / f64::from(PLACES);
    while step.max_element() > 1e-3 {
        let around = [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y].map(|d| best.0 + d * step);
        match around.into_iter().map(|p| (p, room(p))).find(|(_, radius)| *radius > best.1) {
            Some(better) => best = better,
            None => step *= 0.5,
        }
    }
    best
}

/// The outlines of a shell's groove: its foot, wider by the clearance all round.
fn groove_rings(design: &Design, shell: &Shell) -> Vec<Ring> {
    let (low, high, period) = (design.region.low(), design.region.high(), design.period.0);
    let clearance = design.recipe.base.clearance;
    let flat = |p: DVec3| (p - low).truncate() * period;
    let surface = design.surface();
    let mut rings = Vec::new();
    for chain in foot_chains(&shell.sheet, low.z) {
        let side = |copy: &crate::index::IndexVec<VertexId, DVec3>, sign: f64| -> Ring {
            let mut line: Ring = chain
                .vertices
                .iter()
                .map(|&v| {
                    flat(copy[v])
                        + sign * clearance * flat_normal(surface.as_ref(), shell.sheet.mesh().positions[v])
                })
                .collect();
            if !chain.closed {
                // The foot ends on a side face; the groove goes on past it.
                let past = |v: VertexId| clearance * outward(shell.sheet.mesh().positions[v], low, high);
                if let (Some(&first), Some(&last)) = (chain.vertices.first(), chain.vertices.last()) {
                    line.insert(0, line[0] + past(first));
                    line.push(line[line.len() - 1] + past(last));
                }
            }
            line
        };
        let (inner, outer) = (side(&shell.lower, -1.0), side(&shell.upper, 1.0));
        if chain.closed {
            rings.extend([inner, outer]);
        } else {
            rings.push(inner.into_iter().chain(outer.into_iter().rev()).collect());
        }
    }
    rings
}

/// The unit normal of the sheet, within the cut plane.
fn flat_normal(surface: &dyn LevelSet, p: DVec3) -> DVec2 {
    surface.gradient(p).truncate().normalize()
}

/// The direction out of the box at a point on one of its side faces.
fn outward(p: DVec3, low: DVec3, high: DVec3) -> DVec2 {
    let part = |at: f64, low: f64, high: f64| f64::from(i8::from(at >= high) - i8::from(at <= low));
    DVec2::new(part(p.x, low.x, high.x), part(p.y, low.y, high.y))
}

/// A line of the sheet's border in the cut plane.
struct Chain {
    vertices: Vec<VertexId>,
    closed: bool,
}

/// The border of a sheet on the plane `z = height`, as lines from side face to side face, or closed ones.
fn foot_chains(sheet: &Sheet, height: f64) -> Vec<Chain> {
    let on_plane = |v: VertexId| sheet.mesh().positions[v].z <= height;
    let mut next: BTreeMap<VertexId, VertexId> =
        sheet.border().filter(|&(from, to)| on_plane(from) && on_plane(to)).collect();
    let ends: std::collections::BTreeSet<VertexId> = next.values().copied().collect();
    let starts: Vec<VertexId> = next.keys().copied().filter(|v| !ends.contains(v)).collect();
    let mut chains = Vec::new();
    let mut follow = |first: VertexId, closed: bool, next: &mut BTreeMap<VertexId, VertexId>| {
        let mut vertices = vec![first];
        let mut at = first;
        while let Some(to) = next.remove(&at) {
            at = to;
            if at != first {
                vertices.push(at);
            }
        }
        chains.push(Chain { vertices, closed });
    };
    for start in starts {
        follow(start, false, &mut next);
    }
    while let Some((&first, _)) = next.first_key_value() {
        follow(first, true, &mut next);
    }
    chains
}

/// Centres of the entrances: evenly along the middle of the gap, in mm.
fn entrances(design: &Design) -> Result<Vec<DVec2>, BuildError> {
    let count = design.recipe.base.entrances;
    if count == 0 {
        return Ok(Vec::new());
    }
    let low = design.region.low();
    let surface = design.surface();
    let sheet = Sheet::new(march(surface.as_ref(), 0.0, &design.region.grid(LAYOUT_SAMPLES))?)
        .map_err(BuildError::Sheet)?;
    let lines: Vec<Vec<DVec2>> = foot_chains(&sheet, low.z)
        .into_iter()
        .map(|chain| {
            let mut line: Vec<DVec2> = chain
                .vertices
                .iter()
                .map(|&v| (sheet.mesh().positions[v] - low).truncate() * design.period.0)
                .collect();
            if chain.closed {
                line.push(line[0]);
            }
            line
        })
        .collect();
    let length = |line: &[DVec2]| line.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
    let total: f64 = lines.iter().map(|line| length(line)).sum();
    let at = |mut distance: f64| -> DVec2 {
        for line in &lines {
            for step in line.windows(2) {
                let here = step[0].distance(step[1]);
                if distance <= here {
                    return step[0].lerp(step[1], distance / here);
                }
                distance -= here;
            }
        }
        lines.last().and_then(|line| line.last()).copied().unwrap_or(DVec2::ZERO)
    };
    Ok((0..count).map(|i| at((f64::from(i) + 0.5) / f64::from(count) * total)).collect())
}

/// Centres of the screw holes: one in each corner, or none.
fn screws(count: u32, diameter: f64, low: DVec2, high: DVec2) -> Vec<DVec2> {
    if count == 0 {
        return Vec::new();
    }
    let inset = 0.5 * diameter + SCREW_EDGE;
    let (a, b) = (low + inset, high - inset);
    vec![a, DVec2::new(b.x, a.y), b, DVec2::new(a.x, b.y)]
}

/// A regular polygon round the circle: the hole is at least as wide as said in every direction.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a few hundred sides at the most"
)]
fn circle(centre: DVec2, radius: f64) -> Ring {
    let sides = (0.5 * TAU / (radius / (radius + HOLE_SAGITTA)).acos()).ceil().max(8.0) as u32;
    let step = TAU / f64::from(sides);
    let around = radius / (0.5 * step).cos();
    (0..sides).map(|i| centre + around * DVec2::from_angle(step * f64::from(i))).collect()
}

/// Whether a hole keeps clear of all grooves.
fn has_room(field: &'static str, centre: DVec2, radius: f64, grooves: &[Pocket]) -> Result<(), BuildError> {
    let nearest = grooves
        .iter()
        .flat_map(|groove| &groove.rings)
        .map(|ring| distance_to_ring(ring, centre))
        .fold(f64::INFINITY, f64::min);
    let inside = grooves.iter().any(|groove| crate::mesh::plate::inside(&groove.rings, centre));
    if !inside && nearest >= radius + LEAST_LAND {
        return Ok(());
    }
    let room = if inside { 0.0 } else { 2.0 * (nearest - LEAST_LAND).max(0.0) };
    Err(BuildError::Recipe(Fault {
        field,
        message: format!(
            "a hole of {:.2} mm at ({:.1}, {:.1}) mm would cut a groove; there is room for {room:.2} mm there",
            2.0 * radius,
            centre.x,
            centre.y
        ),
    }))
}

/// Whether the holes keep clear of each other.
fn holes_apart(entrances: &[DVec2], entrance: f64, screws: &[DVec2], screw: f64) -> Result<(), BuildError> {
    let holes: Vec<(DVec2, f64)> = entrances
        .iter()
        .map(|&c| (c, 0.5 * entrance))
        .chain(screws.iter().map(|&c| (c, 0.5 * screw)))
        .collect();
    for (i, (a, r)) in holes.iter().enumerate() {
        for (b, s) in &holes[..i] {
            if a.distance(*b) < r + s + LEAST_LAND {
                return Err(BuildError::Recipe(Fault {
                    field: "base.entrances",
                    message: format!(
                        "two holes of the base at ({:.1}, {:.1}) and ({:.1}, {:.1}) mm would run into each other: use fewer or smaller ones",
                        a.x, a.y, b.x, b.y
                    ),
                }));
            }
        }
    }
    Ok(())
}

fn distance_to_ring(ring: &Ring, p: DVec2) -> f64 {
    (0..ring.len())
        .map(|i| {
            let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            p.distance(a.lerp(b, t))
        })
        .fold(f64::INFINITY, f64::min)
}
