//! Numbers and texts as C prints them.

/// A number with `digits` significant digits, in fixed or exponential notation as C's `%g` chooses.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    general(value, digits, false)
}

fn general(value: f64, digits: usize, keep_zeros: bool) -> String {
    if !value.is_finite() {
        return format!("{value}").to_lowercase();
    }
    let digits = digits.max(1);
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| {
        if keep_zeros || !text.contains('.') {
            text.to_owned()
        } else {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
    };
    let most = i32::try_from(digits).unwrap_or(i32::MAX);
    if exponent < -4 || exponent >= most {
        format!("{}e{}{:02}", trimmed(mantissa), if exponent < 0 { '-' } else { '+' }, exponent.abs())
    } else {
        let decimals = usize::try_from(most - 1 - exponent).unwrap_or(0);
        trimmed(&format!("{value:.decimals$}"))
    }
}

/// What is put into a format.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Argument {
    Number(f64),
    Text(String),
}

/// One conversion of a format, such as `%-8.3f`.
#[derive(Default)]
struct Conversion {
    left: bool,
    plus: bool,
    space: bool,
    zero: bool,
    alternate: bool,
    width: usize,
    precision: Option<usize>,
}

/// The widest field: no format may ask for unlimited memory.
const WIDEST: usize = 1000;

/// `printf`: what is wrong with the format if it cannot be filled.
pub(super) fn printf(format: &str, arguments: &[Argument]) -> Result<String, String> {
    let mut out = String::new();
    let mut characters = format.chars().peekable();
    let mut next = arguments.iter();
    while let Some(c) = characters.next() {
        if c != '%' {
            out.push(c);
            continue;
        }
        if characters.peek() == Some(&'%') {
            characters.next();
            out.push('%');
            continue;
        }
        let mut conversion = Conversion::default();
        let mut kind = None;
        let mut in_precision = false;
        for c in characters.by_ref() {
            match c {
                '-' => conversion.left = true,
                '+' => conversion.plus = true,
                ' ' => conversion.space = true,
                '#' => conversion.alternate = true,
                '0' if !in_precision && conversion.width == 0 => conversion.zero = true,
                '.' => {
                    in_precision = true;
                    conversion.precision = Some(0);
                }
                '0'..='9' => {
                    let digit = c.to_digit(10).unwrap_or(0) as usize;
                    let number = if in_precision {
                        conversion.precision.get_or_insert(0)
                    } else {
                        &mut conversion.width
                    };
                    *number = (10 * *number + digit).min(WIDEST);
                }
                'l' | 'h' | 'q' => {}
                other => {
                    kind = Some(other);
                    break;
                }
            }
        }
        let Some(kind) = kind else { return Err("the format ends within a conversion".to_owned()) };
        let Some(argument) = next.next() else {
            return Err(format!("the format has more conversions than the {} values given", arguments.len()));
        };
        out.push_str(&conversion.apply(kind, argument)?);
    }
    Ok(out)
}

impl Conversion {
    fn apply(&self, kind: char, argument: &Argument) -> Result<String, String> {
        let text = match (kind, argument) {
            ('s', Argument::Text(text)) => match self.precision {
                Some(most) => text.chars().take(most).collect(),
                None => text.clone(),
            },
            ('s', Argument::Number(value)) => significant(*value, 15),
            (_, Argument::Text(_)) => return Err(format!("%{kind} needs a number, a text is given")),
            (_, Argument::Number(value)) => self.number(kind, *value)?,
        };
        let length = text.chars().count();
        let blank = self.width.saturating_sub(length);
        Ok(if self.left {
            text + &" ".repeat(blank)
        } else if self.zero && kind != 's' {
            let sign = usize::from(text.starts_with(['-', '+']));
            format!("{}{}{}", &text[..sign], "0".repeat(blank), &text[sign..])
        } else {
            " ".repeat(blank) + &text
        })
    }

    fn number(&self, kind: char, value: f64) -> Result<String, String> {
        let precision = self.precision.unwrap_or(6);
        #[expect(clippy::cast_possible_truncation, reason = "whole numbers are cut as C casts them")]
        let whole = value as i64;
        let text = match kind {
            'd' | 'i' | 'u' => whole.to_string(),
            'x' => format!("{whole:x}"),
            'X' => format!("{whole:X}"),
            'o' => format!("{whole:o}"),
            'c' => {
                u32::try_from(whole).ok().and_then(char::from_u32).map_or(String::new(), |c| c.to_string())
            }
            'f' | 'F' if value.is_finite() => format!("{value:.precision$}"),
            'e' | 'E' if value.is_finite() => {
                let text = format!("{value:.precision$e}");
                let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
                let exponent: i32 = exponent.parse().unwrap_or(0);
                let sign = if exponent < 0 { '-' } else { '+' };
                format!("{mantissa}e{sign}{:02}", exponent.abs())
            }
            'f' | 'F' | 'e' | 'E' | 'g' | 'G' => general(value, precision, self.alternate),
            other => return Err(format!("there is no conversion %{other}")),
        };
        let text = if kind.is_ascii_uppercase() { text.to_uppercase() } else { text };
        Ok(match (value >= 0.0, self.plus, self.space) {
            (true, true, _) => format!("+{text}"),
            (true, false, true) => format!(" {text}"),
            _ => text,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_as_by_c() {
        // Reference: the C standard's printf, on the same values.
        assert_eq!(significant(1_772.233_011_001, 7), "1772.233");
        assert_eq!(significant(1e-7, 6), "1e-07");
        assert_eq!(significant(1e20, 6), "1e+20");
        assert_eq!(significant(0.0001, 6), "0.0001");
        let numbers = |values: &[f64]| values.iter().map(|v| Argument::Number(*v)).collect::<Vec<_>>();
        assert_eq!(
            printf("%5.2f|%-6d|%06d", &numbers(&[3.14259, 42.0, 7.0])),
            Ok(" 3.14|42    |000007".to_owned())
        );
        assert_eq!(printf("%.3e %g%%", &numbers(&[12345.678, 0.5])), Ok("1.235e+04 0.5%".to_owned()));
        assert!(printf("%d %d", &numbers(&[1.0])).is_err());
    }
}
