//! The cells of a line.

use std::borrow::Cow;

/// The cells of a line, trimmed; none when a quoted cell does not end.
pub(super) fn split(text: &str, separator: char) -> Option<Vec<Cow<'_, str>>> {
    if !text.contains('"') {
        return Some(text.split(separator).map(|cell| Cow::Borrowed(cell.trim())).collect());
    }
    let mut cells = Vec::new();
    let mut rest = text;
    loop {
        let begin = rest.trim_start();
        let after = match begin.strip_prefix('"') {
            Some(mut inside) => {
                let mut cell = String::new();
                loop {
                    let end = inside.find('"')?;
                    cell.push_str(&inside[..end]);
                    inside = &inside[end + 1..];
                    // Two quotes stand for one.
                    match inside.strip_prefix('"') {
                        Some(more) => {
                            cell.push('"');
                            inside = more;
                        }
                        None => break,
                    }
                }
                let end = inside.find(separator).unwrap_or(inside.len());
                cell.push_str(inside[..end].trim_end());
                cells.push(Cow::Owned(cell.trim().to_owned()));
                &inside[end..]
            }
            None => {
                let end = begin.find(separator).unwrap_or(begin.len());
                cells.push(Cow::Borrowed(begin[..end].trim()));
                &begin[end..]
            }
        };
        match after.strip_prefix(separator) {
            Some(more) => rest = more,
            None => return Some(cells),
        }
    }
}
