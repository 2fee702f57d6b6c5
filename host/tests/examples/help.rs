//! The examples as the user sees them: out of what `--help` prints.

use std::process::Command;

/// The verbs that `sarah`, or one of its verbs, lists.
pub fn verbs(path: &[&str]) -> Vec<String> {
    let text = help(path);
    let listed = text.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    // Where a description is longer than a line, it goes on further in.
    let first_lines = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = first_lines.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help");
    names.map(str::to_owned).collect()
}

/// The examples of a verb and of the verbs below it, each once.
pub fn examples(verb: &str) -> Vec<String> {
    let mut found = own_examples(&[verb]);
    for below in verbs(&[verb]) {
        found.extend(own_examples(&[verb, &below]));
    }
    let mut once: Vec<String> = vec![];
    for example in found {
        if !once.contains(&example) {
            once.push(example);
        }
    }
    once
}

fn own_examples(path: &[&str]) -> Vec<String> {
    let text = help(path);
    let shown = text.lines().skip_while(|line| !line.starts_with("Example")).skip(1);
    let mut lines: Vec<String> = vec![];
    for line in shown.take_while(|line| !line.is_empty()) {
        match (line.starts_with("  sarah "), lines.last_mut()) {
            // A line that is too long for the terminal goes on in the next.
            (false, Some(last)) => *last += &format!(" {}", line.trim()),
            _ => lines.push(line.trim().to_owned()),
        }
    }
    // What is set off by spaces explains.
    lines.iter().map(|line| line.split("  ").next().unwrap_or_default().to_owned()).collect()
}

fn help(path: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_sarah")).args(path).arg("--help").output().expect("starts");
    assert!(output.status.success(), "{path:?}");
    String::from_utf8(output.stdout).expect("UTF-8")
}
