//! The threads of the engine: some for frames, one for laser scans. A thread that ends before it is told to makes the server
//! fail, and so does one that does not come to the end of a frame ([`crate::supervision::heartbeats`]).

use super::{Engine, Publish};
use crate::{
    frame::{
        intake::FrameJob,
        slots::{FrameOutcome, SlotKey, Slots},
    },
    motion::MotionTracker,
    supervision::{
        panics::Edge,
        threads::{self, Class},
    },
};
use std::{sync::Arc, thread::JoinHandle, time::Instant};

/// The threads.
#[derive(Debug)]
pub struct Workers {
    slots: Arc<Slots<FrameJob>>,
    motion: Arc<MotionTracker>,
    threads: Vec<JoinHandle<()>>,
}

impl Workers {
    /// Starts `count` threads for frames, at least one, and one for laser scans.
    pub fn start(engine: &Engine, count: usize, publish: &Arc<impl Publish>) -> std::io::Result<Self> {
        let mut running = Vec::with_capacity(count + 1);
        for i in 0..count.max(1) {
            let (engine, publish) = (engine.clone(), publish.clone());
            let name = format!("vision-{i}");
            let pulse = engine.vitals.begin(format!("the worker thread {name}"));
            let heart = engine.vitals.hearts().begin(format!("the worker thread {name}"));
            running.push(threads::spawn(Class::Answers, name, move || {
                // Dropped with the thread, however that ends.
                let _pulse = pulse;
                while let Some((key, job)) = engine.slots.take() {
                    heart.beat();
                    let outcome = engine.answer_in_span(&key, &job, publish.as_ref());
                    threads::note_frame(Instant::now());
                    engine.slots.finish(&key, outcome);
                    heart.rest();
                }
            })?);
        }
        let (laser, publish) = (engine.clone(), publish.clone());
        let pulse = engine.vitals.begin("the laser thread");
        let heart = engine.vitals.hearts().begin("the laser thread");
        running.push(threads::spawn(Class::Answers, "laser", move || {
            let _pulse = pulse;
            while let Some((robot, job)) = laser.motion.scans().take() {
                heart.beat();
                let what = format_args!("a scan of robot {robot}");
                laser.vitals.panics().catch(Edge::Scan, what, "it corrects nothing", || {
                    if let Some(pose) = laser.motion.fix_by_scan(&robot, &job, Instant::now()) {
                        publish.pose(&robot, &pose);
                    }
                });
                heart.rest();
            }
        })?);
        Ok(Self { slots: engine.slots.clone(), motion: engine.motion.clone(), threads: running })
    }

    /// Returns when every frame in work is answered. Waits: not for an async thread.
    pub fn stop(self) {
        self.slots.close();
        self.motion.scans().close();
        for thread in self.threads {
            if thread.join().is_err() {
                tracing::error!("worker_panicked");
            }
        }
    }
}

impl Engine {
    /// Answers a frame in a span of its own: by robot, camera, epoch and number it can be followed through the log.
    fn answer_in_span(&self, key: &SlotKey, job: &FrameJob, publish: &dyn Publish) -> FrameOutcome {
        let (robot, camera, frame) = (&key.robot, &key.camera, &job.frame);
        let (epoch, seq) = (frame.epoch, frame.seq);
        let waited_ms = u64::try_from(job.received.elapsed().as_millis()).unwrap_or(u64::MAX);
        tracing::debug_span!("frame", %robot, %camera, epoch, seq, waited_ms)
            .in_scope(|| self.answer_frame(key, job, publish))
    }
}
