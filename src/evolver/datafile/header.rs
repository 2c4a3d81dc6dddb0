//! The order of a datafile's sections, and its settings.

use super::{Model, Reader, Representation};
use crate::evolver::{
    command::Statement,
    error::EvolverError,
    language::{
        TokenKind,
        expression::{ElementKind, Expression, UnaryOperator},
        formula::GRAVITY,
    },
    source::Position,
};
use glam::DMat3;

/// Settings of a word and a number that change nothing here.
const IGNORED_NUMBERS: [&str; 27] = [
    "vertices_predicted",
    "edges_predicted",
    "facets_predicted",
    "facetedges_predicted",
    "bodies_predicted",
    "quantities_predicted",
    "method_instances_predicted",
    "evolver_version",
    "total_time",
    "zoom_vertex",
    "zoom_radius",
    "tolerance",
    "constraint_tolerance",
    "target_tolerance",
    "runge_kutta_flag",
    "jiggle_temperature",
    "temperature",
    "scrollscale",
    "linewidth",
    "thickness",
    "hessian_epsilon",
    "brightness",
    "clip_coeff",
    "slice_coeff",
    "merit_factor",
    "area_weighting",
    "pickvnum",
];

/// Settings of a word alone, or with `on` or `off`, that change nothing here.
const IGNORED_WORDS: [&str; 14] = [
    "soapfilm",
    "keep_originals",
    "keep_macros",
    "volume_method_name",
    "torus_period_display",
    "no_dump",
    "visibility_test",
    "show_trans",
    "sobolev",
    "convert_to_quantities",
    "everything_quantities",
    "autodisplay",
    "suppress_warning",
    "hessian_normal",
];

/// What is refused, with the nearest way to do it.
const REFUSED: [(&str, &str); 37] = [
    ("optimizing_parameter", "scan the parameter with a loop of commands"),
    ("optimising_parameter", "scan the parameter with a loop of commands"),
    ("metric", "only Euclidean space is supported"),
    ("conformal_metric", "only Euclidean space is supported"),
    ("klein_metric", "only Euclidean space is supported"),
    ("simplex_representation", "only films and strings are supported"),
    ("symmetry_group", "use TORUS or TORUS_FILLED with wraps"),
    ("lagrange", "use quadratic elements"),
    ("wulff", ""),
    ("phasefile", "give tensions to the faces"),
    ("mobility", ""),
    ("mobility_tensor", ""),
    ("diffusion", ""),
    ("autopop", "use the command o"),
    ("autopop_quartic", "use the command o"),
    ("autochop", "use the commands l and t"),
    ("area_normalization", "use hessian or hessian_seek, which need no time scale"),
    ("effective_area", "use hessian or hessian_seek, which need no time scale"),
    ("normal_motion", ""),
    ("approximate_curvature", ""),
    ("approx_curvature", ""),
    ("squared_curvature", ""),
    ("square_curvature", ""),
    ("mean_curvature_integral", ""),
    ("gauss_curvature", ""),
    ("hidden_surface", ""),
    ("homothety", ""),
    ("ideal_gas_model", "give pressures or volumes"),
    ("pressure", "give each body a pressure or a volume"),
    ("crystalline_integrand", ""),
    ("insulating_knot_energy", ""),
    ("conducting_knot_energy", ""),
    ("backcull", ""),
    ("rotation_order", ""),
    ("high_constraint", ""),
    ("load_library", ""),
    ("interp_bdry_param", "boundary parameters are always interpolated"),
];

impl Reader {
    /// Everything up to the `read` section.
    pub(super) fn sections(&mut self) -> Result<(), EvolverError> {
        loop {
            if self.cursor.at_end() {
                break;
            }
            let position = self.cursor.position();
            let Some(word) = self.cursor.word() else {
                return self.cursor.expected("a definition, a setting or a section such as «vertices»");
            };
            match word.as_str() {
                "vertices" | "vertex" => {
                    self.data.vertices_at = Some(position);
                    self.vertices()?;
                }
                "edges" | "edge" => self.edges()?,
                "faces" | "facets" | "face" | "facet" => self.faces()?,
                "bodies" | "body" => self.bodies()?,
                "read" => {
                    self.data.read_at = Some(position);
                    self.cursor.bump();
                    break;
                }
                _ => self.definition(&word, position)?,
            }
        }
        if self.data.vertices.is_empty() {
            let message = "the datafile has no vertices: a section «vertices» with lines such as «1  0.0 0.0 0.0» is needed";
            return self.cursor.invalid(self.cursor.position(), message);
        }
        Ok(())
    }

    fn definition(&mut self, word: &str, position: Position) -> Result<(), EvolverError> {
        if !self.data.vertices.is_empty() {
            return self.cursor.expected("edges, faces, bodies, or read");
        }
        self.cursor.bump();
        match word {
            "parameter" => self.parameter()?,
            "constraint" => self.constraint(position)?,
            "boundary" => self.boundary()?,
            "quantity" => self.quantity(position)?,
            "method_instance" => self.method_instance()?,
            "function" => self.function(position)?,
            "procedure" => {
                let action = crate::evolver::command::routine(&mut self.cursor, false)?;
                self.data.prelude.push(Statement { position, action });
                self.cursor.accept(";");
            }
            "define" => self.extra_attribute()?,
            _ => return self.setting(word, position),
        }
        Ok(())
    }

    fn setting(&mut self, word: &str, position: Position) -> Result<(), EvolverError> {
        match word {
            "space_dimension" => self.space_dimension(position)?,
            "surface_dimension" => match self.cursor.integer()? {
                2 => {}
                1 => self.data.representation = Representation::String,
                n => return self.cursor.unsupported(position, &format!("a surface of {n} dimensions"), ""),
            },
            "string" => self.data.representation = Representation::String,
            "linear" => self.data.model = Model::Linear,
            "quadratic" => self.data.model = Model::Quadratic,
            "torus" | "torus_filled" => {
                self.data.filled = word == "torus_filled";
                self.data.periods.get_or_insert(DMat3::IDENTITY);
            }
            "torus_periods" | "periods" | "display_periods" => self.periods(word)?,
            "symmetric_content" => self.data.symmetric_content = true,
            "gravity_constant" => {
                self.cursor.accept(":");
                let value = self.number()?;
                self.data.variables.set(GRAVITY, value);
            }
            "gravity" => self.data.gravity = self.on_or_off(),
            "spring_constant" | "gap_constant" => {
                self.cursor.accept(":");
                self.data.gap_constant = self.number()?;
            }
            "integral_order" | "integral_order_1d" | "integration_order" => {
                self.cursor.accept(":");
                let order = self.cursor.integer()?.clamp(1, 40);
                // n points integrate polynomials of degree 2n − 1; the plain order counts the points.
                let points = if word == "integral_order_1d" { order / 2 + 1 } else { order };
                self.data.edge_points = usize::try_from(points).ok();
            }
            "integral_order_2d" => {
                self.cursor.accept(":");
                self.cursor.integer()?;
                self.data.ignored.push((word.to_owned(), position));
            }
            "scale" => {
                self.cursor.accept(":");
                let value = self.number()?;
                let fixed = self.cursor.accept_word("fixed");
                self.data.scale = Some((value, fixed));
            }
            "scale_limit" => {
                self.cursor.accept(":");
                self.data.scale_limit = Some(self.number()?);
            }
            "view_matrix" => self.skip_numbers((self.data.dimension + 1).pow(2))?,
            "view_transform_generators" | "view_transforms" => {
                self.cursor.accept(":");
                let count = usize::try_from(self.cursor.integer()?).unwrap_or(0).min(10_000);
                for _ in 0..count {
                    self.cursor.accept_word("swap_colors");
                    self.skip_numbers((self.data.dimension + 1).pow(2))?;
                }
            }
            _ => return self.other_setting(word, position),
        }
        Ok(())
    }

    fn other_setting(&mut self, word: &str, position: Position) -> Result<(), EvolverError> {
        if IGNORED_NUMBERS.contains(&word) {
            self.cursor.accept(":");
            self.cursor.accept("=");
            if self.cursor.accept("{") {
                while !self.cursor.accept("}") {
                    self.number()?;
                    self.cursor.accept(",");
                }
            } else if matches!(self.cursor.kind(), TokenKind::Text(_)) {
                self.cursor.bump();
            } else {
                self.number()?;
            }
        } else if IGNORED_WORDS.contains(&word) {
            self.on_or_off();
        } else if let Some((_, hint)) = REFUSED.iter().find(|(name, _)| *name == word) {
            return self.cursor.unsupported(position, &word.to_uppercase(), hint);
        } else {
            let message = format!(
                "«{word}» is no definition or setting of a datafile (does a section such as «vertices» begin before it?)"
            );
            return self.cursor.invalid(position, message);
        }
        if word != "soapfilm" && !word.ends_with("_predicted") {
            self.data.ignored.push((word.to_owned(), position));
        }
        Ok(())
    }

    fn on_or_off(&mut self) -> bool {
        if self.cursor.accept_word("off") {
            return false;
        }
        self.cursor.accept_word("on");
        true
    }

    fn skip_numbers(&mut self, count: usize) -> Result<(), EvolverError> {
        for _ in 0..count {
            self.number()?;
        }
        Ok(())
    }

    fn space_dimension(&mut self, position: Position) -> Result<(), EvolverError> {
        self.data.dimension = match self.cursor.integer()? {
            2 => 2,
            3 => 3,
            n => return self.cursor.unsupported(position, &format!("a space of {n} dimensions"), ""),
        };
        Ok(())
    }

    fn periods(&mut self, word: &str) -> Result<(), EvolverError> {
        let n = self.data.dimension;
        let position = self.cursor.position();
        let mut columns = [[0.0; 3]; 3];
        for (row, column) in columns.iter_mut().enumerate().take(n) {
            for value in column.iter_mut().take(n) {
                *value = self.number()?;
            }
            if n == 2 {
                column[2] = 0.0;
            }
            debug_assert!(row < 3, "at most three periods");
        }
        if n == 2 {
            columns[2] = [0.0, 0.0, 1.0];
        }
        let matrix = DMat3::from_cols_array_2d(&columns);
        if matrix.determinant().abs() < 1e-300 {
            return self.cursor.invalid(position, "the periods do not span space");
        }
        if word != "display_periods" {
            self.data.periods = Some(matrix);
        }
        Ok(())
    }

    fn parameter(&mut self) -> Result<(), EvolverError> {
        let name = self.cursor.expect_word()?;
        if !self.cursor.accept("=") && !self.cursor.accept(":=") {
            return self.cursor.expected("«=» and a value");
        }
        let value = self.number()?;
        self.data.variables.set(&name, value);
        self.data.parameters.push(name.into());
        Ok(())
    }

    /// `define facet attribute name real[3]`, or a variable's declaration.
    fn extra_attribute(&mut self) -> Result<(), EvolverError> {
        let position = self.cursor.position();
        let word = self.cursor.expect_word()?;
        let Some(kind) = ElementKind::named(&word) else {
            let action = crate::evolver::command::array(&mut self.cursor, position, &word)?;
            self.data.prelude.push(Statement { position, action });
            return Ok(());
        };
        let attribute = crate::evolver::command::parse_extra_attribute(&mut self.cursor, kind)?;
        self.data.extra_attributes.push(attribute);
        Ok(())
    }
}

/// The whole number that an expression is, if it is one as written.
pub(super) fn whole(expression: &Expression) -> Option<i64> {
    let (value, sign) = match expression {
        Expression::Number(value) => (*value, 1.0),
        Expression::Unary(UnaryOperator::Negative, inner) => match **inner {
            Expression::Number(value) => (value, -1.0),
            _ => return None,
        },
        _ => return None,
    };
    #[expect(clippy::cast_possible_truncation, reason = "checked to be whole and small")]
    let whole = (value.fract().abs() <= 0.0 && value < 2_147_483_648.0).then_some((sign * value) as i64);
    whole
}
