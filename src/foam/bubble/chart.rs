//! Polar coordinates on the middle surface round a place, and columns from wall to wall.

use super::NoBubble;
use crate::surface::Gap;
use glam::DVec3;

/// Steps of a walk. Walks are smooth functions of angle and distance whatever this is; more of them only bring the rays
/// nearer to geodesics, which keeps the columns of a wide bubble evenly spaced.
const WALK_STEPS: u32 = 24;

/// A place on the middle surface with an orthonormal frame.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    gap: &'a Gap,
    place: DVec3,
    axes: [DVec3; 2],
    normal: DVec3,
}

impl<'a> Chart<'a> {
    /// The chart round the point of the middle surface near `place`.
    ///
    /// # Errors
    /// [`NoBubble::Place`] if the surface is not near.
    pub fn new(gap: &'a Gap, place: DVec3) -> Result<Self, NoBubble> {
        let normal = gap.middle().normal(place);
        Self::with_axis(gap, place, normal.any_orthonormal_pair().0)
    }

    /// The same with the first axis as near to `axis` as the surface allows.
    ///
    /// # Errors
    /// As [`Chart::new`].
    pub fn with_axis(gap: &'a Gap, place: DVec3, axis: DVec3) -> Result<Self, NoBubble> {
        let middle = gap.middle();
        let place = middle.project(place, 0.0).map_err(|_| NoBubble::Place { place })?;
        let normal = middle.normal(place);
        let flat = axis - axis.dot(normal) * normal;
        let first = if flat.length() > 1e-6 { flat.normalize() } else { normal.any_orthonormal_pair().0 };
        Ok(Self { gap, place, axes: [first, normal.cross(first)], normal })
    }

    /// The place, on the middle surface.
    #[must_use]
    pub fn place(&self) -> DVec3 {
        self.place
    }

    /// The two tangents; with the normal they are right-handed.
    #[must_use]
    pub fn axes(&self) -> [DVec3; 2] {
        self.axes
    }

    /// The unit normal of the middle surface.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The gap.
    #[must_use]
    pub fn gap(&self) -> &'a Gap {
        self.gap
    }

    /// The second fundamental form `⟨u, ∇n v⟩` of the middle surface at the place, for tangents `u` and `v`.
    #[must_use]
    pub fn bend(&self, u: DVec3, v: DVec3) -> f64 {
        let middle = self.gap.middle();
        u.dot(middle.hessian(self.place) * v) / middle.gradient(self.place).length()
    }

    /// Where a walk along the surface of this length ends, and its heading there. The heading at the start is
    /// `cos(angle)` of the first axis and `sin(angle)` of the second.
    ///
    /// # Errors
    /// [`NoBubble::Wide`] where the surface is lost.
    pub fn walk(&self, angle: f64, distance: f64) -> Result<(DVec3, DVec3), NoBubble> {
        let middle = self.gap.middle();
        let mut at = self.place;
        let mut heading = angle.cos() * self.axes[0] + angle.sin() * self.axes[1];
        let step = distance / f64::from(WALK_STEPS);
        for _ in 0..WALK_STEPS {
            at = middle.project(at + step * heading, 0.0).map_err(|_| NoBubble::Wide { place: at })?;
            let normal = middle.normal(at);
            heading = (heading - heading.dot(normal) * normal).normalize();
        }
        Ok((at, heading))
    }

    /// The point at these coordinates: the end of the walk towards them.
    ///
    /// # Errors
    /// As [`Chart::walk`].
    pub fn point(&self, x: f64, y: f64) -> Result<DVec3, NoBubble> {
        Ok(self.walk(y.atan2(x), x.hypot(y))?.0)
    }

    /// The feet on the lower and the upper wall from a point of the middle surface, along the gradient.
    ///
    /// # Errors
    /// [`NoBubble::Wide`] if there is none.
    pub fn column(&self, point: DVec3) -> Result<[DVec3; 2], NoBubble> {
        let [lower, upper] = self.gap.walls();
        let foot =
            |wall: &crate::surface::Wall| wall.project(point).map_err(|_| NoBubble::Wide { place: point });
        Ok([foot(lower)?, foot(upper)?])
    }

    /// The gap along the gradient at the place.
    ///
    /// # Errors
    /// As [`Chart::column`].
    pub fn height(&self) -> Result<f64, NoBubble> {
        let [lower, upper] = self.column(self.place)?;
        Ok(lower.distance(upper))
    }
}
