//! Fields that are integrated over facets and along edges.

use crate::evolver::language::formula::Bound;
use glam::{DMat3, DVec3};

/// A vector field.
#[derive(Clone, Debug)]
pub(super) enum VectorField {
    /// `(0, 0, z)`: its flux is the volume below.
    Height,
    /// `x/3`: its flux is the volume of the cone from the origin.
    Cone,
    /// `(0, 0, z²/2)`: its flux is the moment of the volume below.
    HalfSquare,
    /// `(−y, 0, 0)`: its integral round a loop is the area in the plane.
    PlaneHeight,
    /// `(−y, x, 0)/2`: the same, symmetric.
    PlaneCone,
    /// `(−y²/2, 0, 0)`: its integral round a loop is the moment of the area.
    PlaneHalfSquare,
    /// Formulas.
    Formula(Box<[Bound; 3]>),
}

/// A vector field at a place, with `first[i][j] = ∂Fᵢ/∂xⱼ` by rows in `jacobian` and the Hessian of each component.
pub(super) struct FieldJet {
    pub(super) value: DVec3,
    pub(super) jacobian: DMat3,
    /// The second derivatives of each component; `None` where all vanish.
    pub(super) second: Option<[DMat3; 3]>,
}

fn by_rows(rows: [DVec3; 3]) -> DMat3 {
    DMat3::from_cols(rows[0], rows[1], rows[2]).transpose()
}

impl VectorField {
    /// The field that vanishes.
    pub(super) fn zero() -> Self {
        Self::Formula(Box::new([0.0; 3].map(Bound::constant)))
    }

    pub(super) fn value(&self, x: DVec3) -> DVec3 {
        match self {
            Self::Height => DVec3::new(0.0, 0.0, x.z),
            Self::Cone => x / 3.0,
            Self::HalfSquare => DVec3::new(0.0, 0.0, 0.5 * x.z * x.z),
            Self::PlaneHeight => DVec3::new(-x.y, 0.0, 0.0),
            Self::PlaneCone => DVec3::new(-0.5 * x.y, 0.5 * x.x, 0.0),
            Self::PlaneHalfSquare => DVec3::new(-0.5 * x.y * x.y, 0.0, 0.0),
            Self::Formula(bounds) => DVec3::new(bounds[0].value(x), bounds[1].value(x), bounds[2].value(x)),
        }
    }

    pub(super) fn jet(&self, x: DVec3) -> FieldJet {
        let value = self.value(x);
        let (rows, second) = match self {
            Self::Height => ([DVec3::ZERO, DVec3::ZERO, DVec3::Z], None),
            Self::Cone => return FieldJet { value, jacobian: DMat3::IDENTITY * (1.0 / 3.0), second: None },
            Self::HalfSquare => {
                let bend = DMat3::from_cols(DVec3::ZERO, DVec3::ZERO, DVec3::Z);
                ([DVec3::ZERO, DVec3::ZERO, x.z * DVec3::Z], Some([DMat3::ZERO, DMat3::ZERO, bend]))
            }
            Self::PlaneHeight => ([-DVec3::Y, DVec3::ZERO, DVec3::ZERO], None),
            Self::PlaneCone => ([-0.5 * DVec3::Y, 0.5 * DVec3::X, DVec3::ZERO], None),
            Self::PlaneHalfSquare => {
                let bend = DMat3::from_cols(DVec3::ZERO, -DVec3::Y, DVec3::ZERO);
                ([-x.y * DVec3::Y, DVec3::ZERO, DVec3::ZERO], Some([bend, DMat3::ZERO, DMat3::ZERO]))
            }
            Self::Formula(bounds) => {
                let jets = [bounds[0].jet(x), bounds[1].jet(x), bounds[2].jet(x)];
                let value = DVec3::new(jets[0].value, jets[1].value, jets[2].value);
                let jacobian = by_rows([jets[0].gradient, jets[1].gradient, jets[2].gradient]);
                let second = Some([jets[0].hessian, jets[1].hessian, jets[2].hessian]);
                return FieldJet { value, jacobian, second };
            }
        };
        FieldJet { value, jacobian: by_rows(rows), second }
    }

    /// Whether a flat triangle's flux is polynomial of low order, so that the middle is exact for the volume.
    pub(super) fn is_linear(&self) -> bool {
        matches!(self, Self::Height | Self::Cone)
    }
}

impl FieldJet {
    /// `Σ nₖ ∇∇Fₖ`.
    pub(super) fn bend(&self, n: DVec3) -> Option<DMat3> {
        self.second.as_ref().map(|second| n.x * second[0] + n.y * second[1] + n.z * second[2])
    }
}
