//! A document with the tables of studies in it, each between two marks, so that one command makes them anew.
//!
//! ```text
//!  <!-- study push-map -->
//!  … what the study came to; everything between the marks is replaced …
//!  <!-- end of study -->
//! ```

use std::ops::Range;
use std::path::PathBuf;

use super::StudyError;
use crate::run::{read_text, write_atomic};

const END: &str = "<!-- end of study -->";

/// A document that studies write into.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Document {
    path: PathBuf,
}

impl Document {
    /// A document that has a place for each of `studies`.
    pub fn open(path: PathBuf, studies: &[String]) -> Result<Document, StudyError> {
        let document = Document { path };
        let text = read_text(&document.path)?;
        studies.iter().try_for_each(|study| document.place(&text, study).map(|_| ()))?;
        Ok(document)
    }

    /// Puts `content` where `study` has its place.
    pub fn write(&self, study: &str, content: &str) -> Result<(), StudyError> {
        let mut text = read_text(&self.path)?;
        let place = self.place(&text, study)?;
        text.replace_range(place, &format!("\n{}\n", content.trim()));
        Ok(write_atomic(&self.path, text.as_bytes())?)
    }

    /// What lies between the marks of `study`.
    fn place(&self, text: &str, study: &str) -> Result<Range<usize>, StudyError> {
        let begin = format!("<!-- study {study} -->");
        let wrong = || StudyError::NoPlace { document: self.path.clone(), begin: begin.clone(), end: END };
        let from = text.find(&begin).ok_or_else(wrong)? + begin.len();
        let length = text[from..].find(END).ok_or_else(wrong)?;
        match text[from..from + length].contains("<!-- study ") {
            true => Err(wrong()),
            false => Ok(from..from + length),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_between_a_study_s_marks_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.md");
        let text = "Before.\n<!-- study a -->\nold\n<!-- end of study -->\nBetween.\n<!-- study b -->\n<!-- end of study -->\n";
        std::fs::write(&path, text).unwrap();
        let document = Document::open(path.clone(), &["a".into(), "b".into()]).unwrap();
        document.write("a", "| new |\n").unwrap();
        document.write("b", "| other |").unwrap();
        document.write("b", "| again |").unwrap();
        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "Before.\n<!-- study a -->\n| new |\n<!-- end of study -->\nBetween.\n\
             <!-- study b -->\n| again |\n<!-- end of study -->\n"
        );
    }

    #[test]
    fn a_document_without_the_marks_is_refused_with_the_lines_to_add() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.md");
        for text in ["", "<!-- study a -->\n", "<!-- study a -->\n<!-- study b -->\n<!-- end of study -->\n"] {
            std::fs::write(&path, text).unwrap();
            let error = Document::open(path.clone(), &["a".into()]).unwrap_err().to_string();
            assert!(error.contains("<!-- study a -->") && error.contains(END), "{error}");
        }
    }
}
