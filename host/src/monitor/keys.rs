//! What keys mean.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// What the operator wants.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Act {
    /// Motion; asked back before it is sent.
    Arm,
    /// Yes to the question on the screen.
    Yes,
    /// No to it, or away with the help.
    No,
    /// Emergency stop, at once.
    EStop,
    /// Brakes on.
    Disarm,
    /// Unlatch the emergency stop.
    ClearEStop,
    /// Show or hide the help.
    Help,
    /// Leave; the robot goes on.
    Quit,
}

/// The meaning of a key, if it has one.
pub fn keys(event: KeyEvent) -> Option<Act> {
    // A key that is released has had its effect.
    if event.kind == KeyEventKind::Release {
        return None;
    }
    // A terminal without signals delivers Ctrl-C as a key.
    if event.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT) {
        let quits = matches!(event.code, KeyCode::Char('c' | 'C' | 'd' | 'D'));
        return (quits && event.modifiers.contains(KeyModifiers::CONTROL)).then_some(Act::Quit);
    }
    match event.code {
        // Caps lock must not stand between the operator and the brakes.
        KeyCode::Char(' ' | 's' | 'S') => Some(Act::EStop),
        // A held key repeats; only a press of its own may start something.
        _ if event.kind == KeyEventKind::Repeat => None,
        KeyCode::Char('a' | 'A') => Some(Act::Arm),
        KeyCode::Char('d' | 'D') => Some(Act::Disarm),
        KeyCode::Char('c' | 'C') => Some(Act::ClearEStop),
        KeyCode::Char('y' | 'Y') => Some(Act::Yes),
        KeyCode::Char('n' | 'N') | KeyCode::Esc => Some(Act::No),
        KeyCode::Char('?' | 'h' | 'H') => Some(Act::Help),
        KeyCode::Char('q' | 'Q') => Some(Act::Quit),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_do_what_they_say() {
        let plain = |code| keys(KeyEvent::new(code, KeyModifiers::NONE));
        for (character, act) in [
            (' ', Some(Act::EStop)),
            ('s', Some(Act::EStop)),
            ('S', Some(Act::EStop)),
            ('a', Some(Act::Arm)),
            ('d', Some(Act::Disarm)),
            ('c', Some(Act::ClearEStop)),
            ('q', Some(Act::Quit)),
            ('?', Some(Act::Help)),
            ('y', Some(Act::Yes)),
            ('n', Some(Act::No)),
            ('x', None),
        ] {
            assert_eq!(plain(KeyCode::Char(character)), act, "{character:?}");
        }
        assert_eq!(plain(KeyCode::Esc), Some(Act::No));
        assert_eq!(plain(KeyCode::F(1)), None);
    }

    #[test]
    fn ctrl_c_quits_and_does_not_clear_the_emergency_stop() {
        assert_eq!(keys(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Some(Act::Quit));
        assert_eq!(keys(KeyEvent::new(KeyCode::Char('a'), KeyModifiers::CONTROL)), None);
        assert_eq!(keys(KeyEvent::new(KeyCode::Char('a'), KeyModifiers::ALT)), None);
    }

    #[test]
    fn only_the_stop_repeats_and_no_release_counts() {
        let kind = |code, kind| keys(KeyEvent::new_with_kind(code, KeyModifiers::NONE, kind));
        assert_eq!(kind(KeyCode::Char('a'), KeyEventKind::Repeat), None);
        assert_eq!(kind(KeyCode::Char('s'), KeyEventKind::Repeat), Some(Act::EStop));
        assert_eq!(kind(KeyCode::Char('s'), KeyEventKind::Release), None);
    }
}
