//! Commands as trees.
//!
//! | part | file |
//! |---|---|
//! | statements | this page |
//! | words of the control language: loops, conditions, assignments | `parse.rs` |
//! | procedures, functions, arrays and local variables | `routine.rs` |
//! | words that act on the surface | `actions.rs` |

mod actions;
mod parse;
mod routine;

use super::{
    datafile::ExtraAttribute,
    error::EvolverError,
    language::{
        Cursor,
        expression::{ElementKind, Expression, Query},
    },
    source::Position,
};
use std::sync::Arc;

pub(crate) use parse::statements;
pub(crate) use routine::{arguments, array, routine};

/// A statement with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// Where it begins.
    pub position: Position,
    /// What it does.
    pub action: Action,
}

/// How an assignment changes what it assigns to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Assignment {
    /// `:=`
    Set,
    /// `+=`
    Add,
    /// `-=`
    Subtract,
    /// `*=`
    Multiply,
    /// `/=`
    Divide,
}

/// Which elements a command acts on.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// Those that a query finds.
    Query(Query),
    /// One element, by an expression.
    Element(Expression),
}

/// A command with elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElementCommand {
    /// Divides edges.
    Refine,
    /// Deletes elements.
    Delete,
    /// Fixes elements.
    Fix,
    /// Frees them.
    Unfix,
    /// Lists them.
    List,
    /// Averages vertices.
    Average,
    /// Swaps edges where that makes triangles more equal.
    Equiangulate,
    /// Swaps edges.
    Edgeswap,
    /// Pops vertices or edges where more films meet than can.
    Pop,
    /// Exchanges neighbours across short edges of strings.
    T1,
}

/// A command without elements.
#[derive(Clone, Debug, PartialEq)]
pub enum Simple {
    /// `r`
    Refine,
    /// `u`
    Equiangulate,
    /// `V`
    Average,
    /// `v`
    Volumes,
    /// `e`, `c`: counts of elements.
    Counts,
    /// `O`: lines where more than three films meet.
    PopEdges,
    /// `o`: these, and points where more meet than can.
    PopNonminimal,
    /// `U`
    ConjugateGradient(Option<bool>),
    /// `hessian`
    Hessian,
    /// `C`: runs checks.
    Check,
    /// `linear`
    Linear,
    /// `quadratic`
    Quadratic,
    /// `recalc`
    Recalculate,
    /// `convert_to_quantities`
    Quantities,
    /// `i`: information.
    Information,
    /// `e`: the energies of successive refinements and what they tend to.
    Extrapolate,
    /// `A`: variables and their values.
    Variables,
    /// `Q`: quantities and their values.
    NamedQuantities,
    /// `q`, `quit`
    Quit,
    /// `break`
    Break,
    /// `continue`
    Continue,
    /// A command that shows or sets nothing that matters here.
    Nothing,
    /// `help`
    Help,
}

/// A command with a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numeric {
    /// `g`
    Iterate,
    /// `t`
    RemoveShortEdges,
    /// `l`
    DivideLongEdges,
    /// `w`
    RemoveSmallFacets,
    /// `K`
    DivideSkinnyFacets,
    /// `m`
    FixScale,
    /// `G`
    Gravity,
    /// `M`
    Model,
    /// `hessian_seek`
    HessianSeek,
    /// `saddle`
    Saddle,
    /// `eigenprobe`
    Eigenprobe,
    /// `slide`: of this program only.
    Slide,
    /// `n`: notching.
    Notch,
}

/// A procedure or a function with arguments.
#[derive(Clone, Debug, PartialEq)]
pub struct Routine {
    /// The names of its arguments.
    pub arguments: Vec<Arc<str>>,
    /// What it does.
    pub body: Statement,
    /// Whether it returns a number.
    pub function: bool,
}

/// What a statement does.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Several statements.
    Block(Vec<Statement>),
    /// A statement several times.
    Repeat(Box<Statement>, Expression),
    /// `if … then … else …`.
    If(Expression, Box<Statement>, Option<Box<Statement>>),
    /// `while … do …`.
    While(Expression, Box<Statement>),
    /// `do … while …`.
    DoWhile(Box<Statement>, Expression),
    /// `for ( a ; b ; c ) …`.
    For(Box<[Statement; 2]>, Expression, Box<Statement>),
    /// `foreach … do …`.
    Foreach(Query, Box<Statement>),
    /// `name := expression`.
    Assign(Arc<str>, Assignment, Expression),
    /// `name := "text"`.
    AssignText(Arc<str>, Expression),
    /// `name := { … }`.
    Define(Arc<str>, Arc<Statement>),
    /// `procedure name(real a) { … }`, `function real name(real a) { … }`.
    Routine(Arc<str>, Arc<Routine>),
    /// `return`, or `return value`.
    Return(Option<Expression>),
    /// `local a, b`.
    Local(Vec<Arc<str>>),
    /// `define name real[n][m] = {…}`; whether of whole numbers. A variable if there are no sizes.
    DefineArray(Arc<str>, Vec<Expression>, bool, Option<Expression>),
    /// `vv.x += expression`, `body[1].target := expression`.
    AssignMember(Expression, Assignment, Expression),
    /// `set vertex y expression where …`; the attribute may have an index; a bare attribute switches on.
    Set(Query, Arc<str>, Option<Expression>, Option<Expression>),
    /// `unset vertex fixed where …`.
    Unset(Query, Arc<str>, Option<Expression>),
    /// A command on elements.
    Elements(ElementCommand, Target),
    /// A command without elements.
    Simple(Simple),
    /// A command with a number.
    Numeric(Numeric, Option<Expression>),
    /// `ritz(value, count)`.
    Ritz(Expression, Expression),
    /// `print expression`.
    Print(Expression),
    /// `printf "…", a, b` and its kin.
    Printf(Expression, Vec<Expression>),
    /// `histogram(query, expression)`; on logarithmic bins or not.
    Histogram(Query, Expression, bool),
    /// `dump "file"`.
    Dump(Option<Expression>),
    /// A statement whose output goes to a file; appended or not.
    Redirect(Box<Statement>, Expression, bool),
    /// A procedure by its name.
    Call(Arc<str>),
    /// An expression whose value is printed.
    Show(Expression),
    /// A switch such as `gravity on`.
    Toggle(Arc<str>, Option<bool>),
    /// `define vertex attribute …`.
    DefineAttribute(ExtraAttribute),
    /// `list` of something other than elements.
    ListInformation(Arc<str>),
    /// A command that is not supported: its name and the nearest way to do it. It is an error where it runs.
    Refused(Arc<str>, &'static str),
}

/// The rest of `define facet attribute name real[3]` behind the kind.
pub(crate) fn parse_extra_attribute(
    cursor: &mut Cursor,
    kind: ElementKind,
) -> Result<ExtraAttribute, EvolverError> {
    if !cursor.accept_word("attribute") {
        return cursor.expected("«attribute» and its name");
    }
    let name: Arc<str> = cursor.expect_word()?.into();
    let integer = if cursor.accept_word("integer") {
        true
    } else if cursor.accept_word("real") {
        false
    } else {
        return cursor.expected("«real» or «integer»");
    };
    let mut sizes = Vec::new();
    while cursor.accept("[") {
        let position = cursor.position();
        sizes.push(usize::try_from(cursor.integer()?).unwrap_or(0));
        let length = sizes.iter().try_fold(1_usize, |length, &size| length.checked_mul(size));
        if length.is_none_or(|length| length == 0 || length > 1000) {
            return cursor.invalid(position, "an attribute holds between 1 and 1000 numbers");
        }
        cursor.expect("]")?;
    }
    // `function real f(…)` on its own begins the next definition.
    let formula = cursor.word().as_deref() == Some("function")
        && matches!(cursor.ahead(1).kind, crate::evolver::language::TokenKind::Symbol("{"));
    if cursor.is_symbol("(") || formula {
        return cursor.unsupported(cursor.position(), "an attribute with a formula or a variable size", "");
    }
    let length = sizes.iter().product();
    Ok(ExtraAttribute { kind, name, sizes, length, integer })
}
