//! The state in one line, for logs and pipes.

use super::attention::Level;
use super::state::Dashboard;
use super::text::duration;

impl Dashboard {
    /// Everything that matters in one line of text, at this moment of the link's clock.
    pub fn line(&self, now_us: u64) -> String {
        let (_, headline) = self.headline(now_us);
        let mut line = format!("{:8.1} s  {headline}", now_us as f64 * 1e-6);
        if let Some(telemetry) = self.fresh(now_us) {
            let [forward, left] = telemetry.lean.map(|lean| lean.to_f32());
            line += &format!(
                "; Factor {:.3}; {:.1} steps/s, {} in all, cycle {}; lean {forward:+.3} {left:+.3} rad; \
                 generation {} for {}{}",
                telemetry.factor.to_f32(),
                self.trend.steps_per_s(),
                telemetry.steps,
                telemetry.cycle,
                telemetry.generation,
                duration(u64::from(telemetry.generation_age_ms) * 1000),
                if telemetry.stale { " STALE" } else { "" },
            );
        }
        if let Some(health) = &self.health {
            let stats = &health.stats;
            line += &format!(
                "; link {:.0} frames/s, lost {}, CRC errors {}, retries {}, reconnects {}",
                self.trend.frames_per_s(now_us),
                stats.lost,
                stats.frame_errors,
                stats.retries,
                health.reconnects
            );
        }
        for (level, advice) in self.attention(now_us) {
            if level > Level::Calm {
                line += &format!("; {} ({})", advice.what, advice.remedy);
            }
        }
        line
    }
}
