//! Commands that act on the surface or tell of it.

use super::{Action, ElementCommand, Numeric, Simple, Target, parse_extra_attribute};
use crate::evolver::{
    error::EvolverError,
    language::{
        Cursor, TokenKind,
        expression::{ElementKind, Expression},
    },
};

type Parsed = Result<Action, EvolverError>;

/// Switches; those that change nothing here are known by name only.
const TOGGLES: [&str; 45] = [
    "quiet",
    "gravity",
    "conj_grad",
    "hessian_normal",
    "hessian_quiet",
    "autorecalc",
    "show_all_edges",
    "metric_conversion",
    "gv_binary",
    "force_deletion",
    "memdebug",
    "runge_kutta",
    "diffusion",
    "check_increase",
    "autodisplay",
    "shading",
    "clip_view",
    "quietgo",
    "quietload",
    "pinning",
    "post_project",
    "normal_motion",
    "area_normalization",
    "itdebug",
    "kraynikpopedge",
    "kraynikpopvertex",
    "view_4d",
    "linear_metric",
    "line_search",
    "kusner",
    "conf_edge",
    "sparse_constraints",
    "ysmp",
    "thicken",
    "debug",
    "calculus_warnings",
    "break_after_warning",
    "bezier_basis",
    "raw_cells",
    "show_inner",
    "show_outer",
    "hessian_special_normal",
    "big_endian",
    "little_endian",
    "verbose",
];

/// Commands of the display: there is none here.
const DISPLAY: [&str; 12] = [
    "show",
    "showq",
    "show_off",
    "geomview",
    "postscript",
    "zoom",
    "view_matrix",
    "transform_expr",
    "transforms",
    "binary_off",
    "ps_colorflag",
    "geompipe",
];

/// Commands of Surface Evolver that are not supported, with the nearest way to do it.
const REFUSED: [(&str, &str); 33] = [
    ("lagrange", "quadratic elements are supported: quadratic"),
    ("addload", "put all elements into one datafile"),
    ("load", "run another datafile: combwright evolver run FILE"),
    ("permload", "run another datafile: combwright evolver run FILE"),
    ("replace_load", "run another datafile: combwright evolver run FILE"),
    ("read", "pass the commands with -c or on standard input"),
    ("system", ""),
    ("exec", ""),
    ("chdir", ""),
    ("burchard", "use hessian_seek"),
    ("vertex_merge", ""),
    ("edge_merge", ""),
    ("facet_merge", ""),
    ("dissolve", "use delete"),
    ("divide", ""),
    ("notch", ""),
    ("jiggle", "set the coordinates of vertices with a formula"),
    ("longj", "set the coordinates of vertices with a formula"),
    ("homothety", ""),
    ("reverse_orientation", ""),
    ("rebody", ""),
    ("pop_quad_to_quad", "T1s of whole foams: combwright foam"),
    ("pop_tri_to_edge", "T1s of whole foams: combwright foam"),
    ("pop_edge_to_tri", "T1s of whole foams: combwright foam"),
    ("body_metis", ""),
    ("new_vertex", ""),
    ("new_edge", ""),
    ("new_facet", ""),
    ("new_body", ""),
    ("optimize", "the scale of g is always optimised; m VALUE fixes it"),
    ("lanczos", "use ritz(value, count)"),
    ("hessian_menu", "use hessian, hessian_seek, eigenprobe or ritz"),
    ("breakpoint", ""),
];

/// The same, for commands of one letter.
const REFUSED_LETTERS: [(&str, &str); 18] = [
    ("a", ""),
    ("b", "set a body's number: body[1].target := value, body[1].pressure := value"),
    ("f", ""),
    ("F", "redirect the output of commands with >>"),
    ("j", "set the coordinates of vertices with a formula"),
    ("J", "set the coordinates of vertices with a formula"),
    ("k", "set gap_constant in the datafile"),
    ("n", "refine edges where the dihedral angle is large: refine edge where dihedral > a"),
    ("N", "set a body's number: body[1].target := body[1].volume"),
    ("p", "set a body's number: body[1].pressure := value"),
    ("P", "pictures of foams: combwright foam"),
    ("W", ""),
    ("X", "list the elements"),
    ("y", ""),
    ("z", ""),
    ("Z", ""),
    ("E", "dump writes the surface"),
    ("L", "redirect the output of commands with >>"),
];

/// Single letters mean different things in lower and upper case.
fn letter(cursor: &mut Cursor, letter: &str) -> Option<Parsed> {
    let simple = |simple| Some(Ok(Action::Simple(simple)));
    let numeric = match letter {
        "g" => Numeric::Iterate,
        "t" => Numeric::RemoveShortEdges,
        "l" => Numeric::DivideLongEdges,
        "w" => Numeric::RemoveSmallFacets,
        "K" => Numeric::DivideSkinnyFacets,
        "m" => Numeric::FixScale,
        "G" => Numeric::Gravity,
        "M" => Numeric::Model,
        "r" => return simple(Simple::Refine),
        "u" => return simple(Simple::Equiangulate),
        "V" => return simple(Simple::Average),
        "v" => return simple(Simple::Volumes),
        "c" => return simple(Simple::Counts),
        "e" => return simple(Simple::Extrapolate),
        "A" => return simple(Simple::Variables),
        "Q" => return simple(Simple::NamedQuantities),
        "o" => return simple(Simple::PopNonminimal),
        "O" => return simple(Simple::PopEdges),
        "U" => return simple(Simple::ConjugateGradient(None)),
        "C" => return simple(Simple::Check),
        "i" => return simple(Simple::Information),
        "q" | "x" => return simple(Simple::Quit),
        "d" => return Some(optional_text(cursor).map(Action::Dump)),
        "s" | "D" | "S" => return simple(Simple::Nothing),
        "h" => return simple(Simple::Help),
        _ => {
            let (_, hint) = REFUSED_LETTERS.iter().find(|(name, _)| *name == letter)?;
            skip_statement(cursor);
            return Some(Ok(Action::Refused(letter.into(), hint)));
        }
    };
    let number = match cursor.kind() {
        TokenKind::Symbol(";" | "}" | ")" | ">>") | TokenKind::End => Ok(None),
        _ if cursor.token().first_on_line => Ok(None),
        _ => cursor.expression().map(Some),
    };
    Some(number.map(|number| Action::Numeric(numeric, number)))
}

/// The command that begins with `word`, in lower case.
pub(super) fn action(cursor: &mut Cursor, word: &str) -> Parsed {
    if let TokenKind::Word(raw) = cursor.kind().clone()
        && raw.chars().count() == 1
    {
        cursor.bump();
        if let Some(parsed) = letter(cursor, &raw) {
            return parsed;
        }
        cursor.rewind(cursor.mark() - 1);
    }
    if let Some((_, hint)) = REFUSED.iter().find(|(name, _)| *name == word) {
        cursor.bump();
        skip_statement(cursor);
        return Ok(Action::Refused(word.into(), hint));
    }
    cursor.bump();
    if let Some(parsed) = element_command(cursor, word) {
        return parsed;
    }
    if let Some(parsed) = plain_command(cursor, word) {
        return parsed;
    }
    if TOGGLES.contains(&word) {
        return Ok(Action::Toggle(word.into(), on_or_off(cursor)));
    }
    if DISPLAY.contains(&word) {
        skip_statement(cursor);
        return Ok(Action::Simple(Simple::Nothing));
    }
    // A procedure's name stands alone; anything else is an expression whose value is shown.
    let ends = cursor.at_end() || cursor.token().first_on_line;
    let separated =
        matches!(cursor.kind(), TokenKind::Symbol(";" | "}" | ")" | ">>" | "|") | TokenKind::Number(..));
    if ends || separated || cursor.word().is_some() {
        return Ok(Action::Call(word.into()));
    }
    cursor.rewind(cursor.mark() - 1);
    Ok(Action::Show(cursor.expression()?))
}

/// Goes to the end of a statement, brackets and all.
fn skip_statement(cursor: &mut Cursor) {
    let mut depth = 0_usize;
    while !cursor.at_end() {
        match cursor.kind() {
            TokenKind::Symbol("{" | "(" | "[") => depth += 1,
            TokenKind::Symbol("}" | ")" | "]") if depth == 0 => return,
            TokenKind::Symbol("}" | ")" | "]") => depth -= 1,
            TokenKind::Symbol(";") if depth == 0 => return,
            _ if depth == 0 && cursor.token().first_on_line => return,
            _ => {}
        }
        cursor.bump();
    }
}

fn on_or_off(cursor: &mut Cursor) -> Option<bool> {
    if cursor.accept_word("on") {
        Some(true)
    } else if cursor.accept_word("off") {
        Some(false)
    } else {
        None
    }
}

pub(super) fn optional_number(cursor: &mut Cursor) -> Result<Option<Expression>, EvolverError> {
    let ends = cursor.at_end()
        || cursor.token().first_on_line
        || matches!(cursor.kind(), TokenKind::Symbol(";" | "}" | ")" | ">>" | "|"));
    if ends { Ok(None) } else { cursor.expression().map(Some) }
}

fn plain_command(cursor: &mut Cursor, word: &str) -> Option<Parsed> {
    let simple = |simple| Some(Ok(Action::Simple(simple)));
    Some(match word {
        "hessian" => return simple(Simple::Hessian),
        "linear" => return simple(Simple::Linear),
        "quadratic" => return simple(Simple::Quadratic),
        "recalc" => return simple(Simple::Recalculate),
        "convert_to_quantities" => return simple(Simple::Quantities),
        "quit" | "exit" | "bye" => return simple(Simple::Quit),
        "help" => optional_text(cursor).map(|_| Action::Simple(Simple::Help)),
        "counts" => return simple(Simple::Counts),
        "equiangulate_all" => return simple(Simple::Equiangulate),
        "u" => return simple(Simple::Equiangulate),
        "conj_grad" => Ok(Action::Simple(Simple::ConjugateGradient(on_or_off(cursor)))),
        "hessian_seek" => optional_number(cursor).map(|n| Action::Numeric(Numeric::HessianSeek, n)),
        "saddle" => optional_number(cursor).map(|n| Action::Numeric(Numeric::Saddle, n)),
        "eigenprobe" => optional_number(cursor).map(|n| Action::Numeric(Numeric::Eigenprobe, n)),
        "slide" => optional_number(cursor).map(|n| Action::Numeric(Numeric::Slide, n)),
        "ritz" => ritz(cursor),
        "print" => cursor.expression().map(Action::Print),
        "printf" | "errprintf" => printf(cursor),
        "histogram" | "loghistogram" => histogram(cursor, word == "loghistogram"),
        "dump" => optional_text(cursor).map(Action::Dump),
        "define" => define(cursor),
        "list" => list(cursor),
        _ => return None,
    })
}

fn optional_text(cursor: &mut Cursor) -> Result<Option<Expression>, EvolverError> {
    optional_number(cursor)
}

fn ritz(cursor: &mut Cursor) -> Parsed {
    cursor.expect("(")?;
    let value = cursor.expression()?;
    cursor.expect(",")?;
    let count = cursor.expression()?;
    cursor.expect(")")?;
    Ok(Action::Ritz(value, count))
}

fn printf(cursor: &mut Cursor) -> Parsed {
    let parentheses = cursor.accept("(");
    let format = cursor.expression()?;
    let mut arguments = Vec::new();
    while cursor.accept(",") {
        arguments.push(cursor.expression()?);
    }
    if parentheses {
        cursor.expect(")")?;
    }
    Ok(Action::Printf(format, arguments))
}

fn histogram(cursor: &mut Cursor, logarithmic: bool) -> Parsed {
    cursor.expect("(")?;
    let query = cursor.query()?;
    cursor.expect(",")?;
    let value = cursor.expression()?;
    cursor.expect(")")?;
    Ok(Action::Histogram(query, value, logarithmic))
}

fn define(cursor: &mut Cursor) -> Parsed {
    let position = cursor.position();
    let word = cursor.expect_word()?;
    match ElementKind::named(&word) {
        Some(kind) => parse_extra_attribute(cursor, kind).map(Action::DefineAttribute),
        None => super::routine::array(cursor, position, &word),
    }
}

fn list(cursor: &mut Cursor) -> Parsed {
    if let Some(word) = cursor.word()
        && [
            "topinfo",
            "bottominfo",
            "attributes",
            "procedures",
            "constraint",
            "boundary",
            "quantity",
            "variables",
        ]
        .contains(&word.as_str())
    {
        cursor.bump();
        while matches!(cursor.kind(), TokenKind::Number(..)) && !cursor.token().first_on_line {
            cursor.bump();
        }
        return Ok(Action::ListInformation(word.into()));
    }
    Ok(Action::Elements(ElementCommand::List, target(cursor)?))
}

fn target(cursor: &mut Cursor) -> Result<Target, EvolverError> {
    let mark = cursor.mark();
    match cursor.query() {
        Ok(query) => Ok(Target::Query(query)),
        Err(error) => {
            cursor.rewind(mark);
            // The name of one element, as in `fix vv`.
            match (cursor.word(), cursor.postfix()) {
                (Some(word), Ok(expression)) if ElementKind::named(&word).is_none() => {
                    Ok(Target::Element(expression))
                }
                _ => Err(error),
            }
        }
    }
}

fn element_command(cursor: &mut Cursor, word: &str) -> Option<Parsed> {
    let command = match word {
        "refine" => ElementCommand::Refine,
        "delete" => ElementCommand::Delete,
        "fix" => ElementCommand::Fix,
        "unfix" => ElementCommand::Unfix,
        "vertex_average" => ElementCommand::Average,
        "equiangulate" => ElementCommand::Equiangulate,
        "edgeswap" => ElementCommand::Edgeswap,
        "pop" => ElementCommand::Pop,
        "t1_edgeswap" => ElementCommand::T1,
        "set" => return Some(set(cursor)),
        "unset" => return Some(unset(cursor)),
        _ => return None,
    };
    Some(target(cursor).map(|target| Action::Elements(command, target)))
}

fn set(cursor: &mut Cursor) -> Parsed {
    let (mut query, attribute, index) = attribute_of(cursor)?;
    let bare = matches!(
        attribute.as_str(),
        "fixed" | "no_refine" | "bare" | "noncontent" | "no_display" | "hit_constraint"
    );
    cursor.accept(":=");
    let value = if bare { None } else { Some(value(cursor)?) };
    if cursor.accept_word("where") {
        query.filter = Some(cursor.expression()?);
    }
    Ok(Action::Set(query, attribute.into(), index, value))
}

fn unset(cursor: &mut Cursor) -> Parsed {
    let (mut query, attribute, index) = attribute_of(cursor)?;
    let numbered = matches!(attribute.as_str(), "constraint" | "constraints" | "boundary");
    let value = if numbered && index.is_none() { Some(cursor.postfix()?) } else { index };
    if cursor.accept_word("where") {
        query.filter = Some(cursor.expression()?);
    }
    Ok(Action::Unset(query, attribute.into(), value))
}

/// A value: an expression, or the name of a colour.
fn value(cursor: &mut Cursor) -> Result<Expression, EvolverError> {
    if let Some(word) = cursor.word()
        && let Some(color) = crate::evolver::datafile::color_named(&word)
    {
        cursor.bump();
        return Ok(Expression::Number(f64::from(color)));
    }
    cursor.expression()
}

/// Elements and the attribute that is set: `vertex y`, `vertex vv y`, `body[2] target`, `vertex ref[2]`.
fn attribute_of(
    cursor: &mut Cursor,
) -> Result<(crate::evolver::language::expression::Query, String, Option<Expression>), EvolverError> {
    let position = cursor.position();
    let query = match target(cursor)? {
        Target::Query(query) => query,
        Target::Element(_) => {
            let hint = "assign with the element's name: vv.x := …";
            return cursor.unsupported(position, "set with a named element", hint);
        }
    };
    if query.filter.is_some() && query.owner.is_none() && cursor.word().is_none() {
        return cursor.expected("the attribute to set before «where»");
    }
    // The word taken for a name is the attribute if no other follows.
    let ends = cursor.at_end() || cursor.token().first_on_line;
    let (query, attribute) = match (query.name.clone(), cursor.word()) {
        (Some(name), next)
            if ends || next.is_none() || next.as_deref() == Some("where") || !is_attribute_word(cursor) =>
        {
            (crate::evolver::language::expression::Query { name: None, ..query }, name.to_string())
        }
        (_, Some(_)) => (query, cursor.expect_word()?),
        _ => return cursor.expected("an attribute"),
    };
    let index = if cursor.accept("[") {
        let index = cursor.expression()?;
        cursor.expect("]")?;
        Some(index)
    } else {
        None
    };
    Ok((query, attribute, index))
}

/// Whether the word here can be an attribute that follows an element's name.
fn is_attribute_word(cursor: &Cursor) -> bool {
    let known = [
        "x",
        "y",
        "z",
        "fixed",
        "constraint",
        "tension",
        "density",
        "color",
        "volume",
        "target",
        "pressure",
        "volconst",
        "no_refine",
        "boundary",
        "frontcolor",
        "backcolor",
        "opacity",
    ];
    cursor.word().is_some_and(|word| known.contains(&word.as_str()))
}
