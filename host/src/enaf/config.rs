//! What a training session can be told: one flat, validated table.

use serde::{Deserialize, Serialize};

use super::EnafError;

/// How the action μ is made and which numbers go with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// The paper's form (§III.C, §IV): μ(x) = tanh(head), one-step targets, OU noise and the coin.
    Paper,
    /// μ = tanh(m + gate · bound · tanh(head)): a learned constant vector m, and a bounded part that depends on the
    /// state, starts at zero and is let in only after [`EnafConfig::residual_after`] episodes, if ever.
    #[default]
    ConstantsFirst,
}

/// Exploration: an Ornstein–Uhlenbeck process, a constant offset per episode, and the coin that switches both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseConfig {
    /// Pull of the OU process back to zero, per decision.
    pub theta: f32,
    /// Width of the OU process' kicks, in action units (the action range is [-1, 1]).
    pub sigma: f32,
    /// Width of the offset drawn once per episode, action units. Absent: the form's own (paper 0, else 0.5).
    pub offset_sigma: Option<f32>,
    /// Both widths fall as `exp(-episode / decay_episodes)` once the warm-up is over.
    pub decay_episodes: f32,
    /// Probability that an episode explores at all (the second half of the paper's double randomness).
    pub coin: f64,
}

impl Default for NoiseConfig {
    fn default() -> Self {
        Self { theta: 0.15, sigma: 0.3, offset_sigma: None, decay_episodes: 250.0, coin: 0.5 }
    }
}

/// Everything that shapes one training session. In TOML, what is absent takes its default; the fields that are an
/// `Option` default to what belongs to [`EnafConfig::form`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnafConfig {
    /// How μ is made.
    pub form: Form,
    /// A GRU encoder (true) or one feed-forward tanh layer (false). With learned constants memory serves only V; where
    /// observations say nothing, V with a memory learns stored episodes by heart and the search is slower.
    pub recurrent: bool,
    /// Show the network the previous action. Absent: the form's own (paper yes, else no).
    ///
    /// A constant search must not: an episode's offset shows in every previous action, V would learn to predict what
    /// the offset costs, and the advantage, from which the constants learn, would be left with nothing to explain.
    pub previous_action: Option<bool>,
    /// LayerNorm after the dense layer.
    pub layer_norm: bool,
    /// Units of the encoder and of the dense layer, at most 1024. Absent: the form's own (paper 32, else 4).
    ///
    /// A constant search wants a small one: a V that can learn the few stored episodes by heart explains what the
    /// offsets cost, and the advantage, from which the constants learn, is left with nothing to explain.
    pub hidden: Option<usize>,
    /// The longest episode, decisions. An episode that reaches it ends as a time-out.
    pub horizon: usize,
    /// The longest unroll learned from, decisions: a batch is trimmed to it, always from the episode's start.
    pub unroll: usize,
    /// Learn from pieces of this many decisions, drawn at random from the stored episodes and begun with an empty memory,
    /// as a replay of single transitions does. Absent: from whole episodes, as the paper does.
    pub piece: Option<usize>,
    /// Episodes in one batch.
    pub batch_episodes: usize,
    /// Training depth: gradient steps per decision (§IV).
    pub depth: usize,
    /// Episodes that are only collected, all of them exploring; their gradient steps are made up for afterwards.
    /// Absent: the form's own (paper 0, else 8).
    pub warm_up_episodes: Option<usize>,
    /// Episodes the replay keeps; the oldest leaves first.
    pub replay_episodes: usize,
    /// Discount per decision.
    pub gamma: f32,
    /// Mixing of n-step returns; 0 is the one-step target. Absent: the form's own (paper 0, else 0.9).
    pub lambda: Option<f32>,
    /// Adam's step size. Absent: the form's own (paper 1e-3, else 1e-2).
    pub learning_rate: Option<f32>,
    /// Share of the online weights that enters the target network per gradient step.
    pub tau: f32,
    /// Gradients longer than this (global norm) are shortened to it.
    pub max_grad_norm: f32,
    /// Errors beyond this count linearly (Huber), in units of return.
    pub huber_delta: f32,
    /// Train two networks and bootstrap from the smaller of their two V.
    pub twin: bool,
    /// Constants-first only: open the gate of the state-dependent part after this many episodes. Absent: never.
    pub residual_after: Option<usize>,
    /// Constants-first only: the largest state-dependent change of an action, action units.
    pub residual_bound: f32,
    /// How many of the latest noise-free episodes [`super::Trainer::mean_action`] averages.
    pub average_episodes: usize,
    /// Exploration.
    pub noise: NoiseConfig,
}

impl Default for EnafConfig {
    fn default() -> Self {
        Self {
            form: Form::ConstantsFirst,
            recurrent: true,
            previous_action: None,
            layer_norm: true,
            hidden: None,
            horizon: 30,
            unroll: 30,
            piece: None,
            batch_episodes: 8,
            depth: 6,
            warm_up_episodes: None,
            replay_episodes: 2000,
            gamma: 0.9,
            lambda: None,
            learning_rate: None,
            tau: 0.01,
            max_grad_norm: 1.0,
            huber_delta: 1.0,
            twin: false,
            residual_after: None,
            residual_bound: 0.3,
            average_episodes: 6,
            noise: NoiseConfig::default(),
        }
    }
}

impl EnafConfig {
    /// The defaults of `form`.
    #[must_use]
    pub fn for_form(form: Form) -> Self {
        Self { form, ..Self::default() }
    }

    /// Whether the network sees the previous action.
    #[must_use]
    pub fn previous_action(&self) -> bool {
        self.previous_action.unwrap_or(self.form == Form::Paper)
    }

    /// λ of the targets.
    #[must_use]
    pub fn lambda(&self) -> f32 {
        self.lambda.unwrap_or(match self.form {
            Form::Paper => 0.0,
            Form::ConstantsFirst => 0.9,
        })
    }

    /// Adam's step size.
    #[must_use]
    pub fn learning_rate(&self) -> f32 {
        self.learning_rate.unwrap_or(match self.form {
            Form::Paper => 1e-3,
            Form::ConstantsFirst => 1e-2,
        })
    }

    /// Units of the encoder and of the dense layer.
    #[must_use]
    pub fn hidden(&self) -> usize {
        self.hidden.unwrap_or(match self.form {
            Form::Paper => 32,
            Form::ConstantsFirst => 4,
        })
    }

    /// Width of the offset drawn once per episode, action units.
    #[must_use]
    pub fn offset_sigma(&self) -> f32 {
        self.noise.offset_sigma.unwrap_or(match self.form {
            Form::Paper => 0.0,
            Form::ConstantsFirst => 0.5,
        })
    }

    /// Episodes collected before the first gradient step.
    #[must_use]
    pub fn warm_up_episodes(&self) -> usize {
        self.warm_up_episodes.unwrap_or(match self.form {
            Form::Paper => 0,
            Form::ConstantsFirst => 8,
        })
    }

    /// The same session with every default of the form written out, for a run's record.
    #[must_use]
    pub fn resolved(&self) -> Self {
        let mut resolved = self.clone();
        resolved.previous_action = Some(self.previous_action());
        resolved.lambda = Some(self.lambda());
        resolved.hidden = Some(self.hidden());
        resolved.learning_rate = Some(self.learning_rate());
        resolved.warm_up_episodes = Some(self.warm_up_episodes());
        resolved.noise.offset_sigma = Some(self.offset_sigma());
        resolved
    }

    /// Refuses what cannot train, naming the field.
    ///
    /// # Errors
    /// [`EnafError::Config`] with the field and the range it must lie in.
    pub fn validate(&self) -> Result<(), EnafError> {
        // Upper bounds keep a slip of the finger from asking for more memory or time than any machine here has.
        let counts = [
            ("hidden", self.hidden(), 1..=1024, "1 to 1024"),
            ("horizon", self.horizon, 1..=3600, "1 to 3600"),
            ("unroll", self.unroll, 1..=3600, "1 to 3600"),
            ("piece", self.piece.unwrap_or(1), 1..=3600, "1 to 3600"),
            ("batch_episodes", self.batch_episodes, 1..=256, "1 to 256"),
            ("depth", self.depth, 0..=256, "0 to 256"),
            ("replay_episodes", self.replay_episodes, 1..=1_000_000, "1 to 1000000"),
            ("average_episodes", self.average_episodes, 1..=1_000_000, "1 to 1000000"),
        ];
        for (field, value, range, rule) in counts {
            if !range.contains(&value) {
                return Err(EnafError::Config { field, rule });
            }
        }
        let positive = |x: f32| x.is_finite() && x > 0.0;
        let not_negative = |x: f32| x.is_finite() && x >= 0.0;
        let rules = [
            ("gamma", (0.0..1.0).contains(&self.gamma), "in [0, 1)"),
            ("lambda", (0.0..=1.0).contains(&self.lambda()), "in [0, 1]"),
            ("learning_rate", positive(self.learning_rate()), "above 0"),
            ("tau", self.tau > 0.0 && self.tau <= 1.0, "in (0, 1]"),
            ("max_grad_norm", positive(self.max_grad_norm), "above 0"),
            ("huber_delta", positive(self.huber_delta), "above 0"),
            ("residual_bound", (0.0..=1.0).contains(&self.residual_bound), "in [0, 1]"),
            ("noise.theta", self.noise.theta > 0.0 && self.noise.theta <= 1.0, "in (0, 1]"),
            ("noise.sigma", not_negative(self.noise.sigma), "0 or more"),
            ("noise.offset_sigma", not_negative(self.offset_sigma()), "0 or more"),
            ("noise.decay_episodes", positive(self.noise.decay_episodes), "above 0"),
            ("noise.coin", (0.0..=1.0).contains(&self.noise.coin), "in [0, 1]"),
            (
                "residual_after",
                self.form == Form::ConstantsFirst || self.residual_after.is_none(),
                "absent in the paper form, whose action depends on the state from the start",
            ),
        ];
        match rules.into_iter().find(|(_, holds, _)| !holds) {
            Some((field, _, rule)) => Err(EnafError::Config { field, rule }),
            None => Ok(()),
        }
    }
}
