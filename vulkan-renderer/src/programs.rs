//! Programs of a device, each compiled in a thread of its own, so that whoever waits for one can give up.
//!
//! ```text
//! prepare ──► thread: the driver compiles ──► ready, kept with the device
//! wait    ──► ready, or the job is cancelled: the thread goes on, and the program is there for the next who asks
//! ```
//! Drivers offer no way to end a compilation. One that nobody waits for ends by itself, also after the renderer is gone, whose device it keeps until
//! then. A process must not end meanwhile, since the driver's own end would take the compiler's memory away under it: [`finish_compiling`].

use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pumice_core::Job;
use pumice_transport::RenderError;

use crate::device::{DeviceError, Gpu, abandon_compiling};
use crate::program::Program;
use crate::scene::UploadError;
use crate::shaders::{Entry, program};

/// Compilations at once. Beyond them [`Programs::prepare`] begins no other: edits of a scene may ask for one each.
const MOST_AT_ONCE: usize = 2;
/// Interval at which a caller that waits for a program polls its job for cancellation.
const POLL_INTERVAL: Duration = Duration::from_millis(10);
/// Compilers call themselves deeply; threads have 2 MiB by default. Only what is used is taken from memory.
const STACK_BYTES: usize = 64 << 20;

/// Programs by entry and specialisation constants: as many as there were kinds of scenes.
#[derive(Debug, Default)]
pub(crate) struct Programs(Vec<(Entry, Vec<u32>, State)>);

#[derive(Debug)]
enum State {
    Compiling(Receiver<Result<Program, DeviceError>>),
    Ready(Program),
}

impl Programs {
    /// Begins to compile a program, unless it is there or on its way, and returns whether it is there.
    pub(crate) fn prepare(
        &mut self,
        gpu: &Gpu,
        entry: Entry,
        constants: &[u32],
    ) -> Result<bool, DeviceError> {
        if self.place(entry, constants).is_none() {
            let under_way = self.0.iter().filter(|(_, _, state)| matches!(state, State::Compiling(_)));
            if under_way.count() >= MOST_AT_ONCE {
                self.collect();
                return Ok(false);
            }
        }
        let place = self.begun(gpu, entry, constants);
        let State::Compiling(made) = &self.0[place].2 else { return Ok(true) };
        match made.try_recv() {
            Err(TryRecvError::Empty) => Ok(false),
            Ok(made) => self.keep(place, made).map(|()| true),
            Err(TryRecvError::Disconnected) => self.keep(place, Err(ended())).map(|()| true),
        }
    }

    /// The program of an entry; compiles it on first use, and waits for that.
    ///
    /// # Errors
    /// [`RenderError::Cancelled`] soon after the job is.
    pub(crate) fn wait(
        &mut self,
        gpu: &Gpu,
        entry: Entry,
        constants: &[u32],
        job: &Job,
    ) -> Result<&mut Program, UploadError> {
        let place = self.begun(gpu, entry, constants);
        while let State::Compiling(made) = &self.0[place].2 {
            match made.recv_timeout(POLL_INTERVAL) {
                Ok(made) => self.keep(place, made)?,
                Err(RecvTimeoutError::Disconnected) => self.keep(place, Err(ended()))?,
                Err(RecvTimeoutError::Timeout) if job.is_cancelled() => {
                    return Err(RenderError::Cancelled.into());
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
        match &mut self.0[place].2 {
            State::Ready(program) => Ok(program),
            State::Compiling(_) => Err(ended().into()),
        }
    }

    /// The programs that are there.
    pub(crate) fn ready(&self) -> impl Iterator<Item = &Program> {
        self.0.iter().filter_map(|(_, _, state)| match state {
            State::Ready(program) => Some(program),
            State::Compiling(_) => None,
        })
    }

    /// As [`Self::ready`], to be changed.
    pub(crate) fn ready_mut(&mut self) -> impl Iterator<Item = &mut Program> {
        self.0.iter_mut().filter_map(|(_, _, state)| match state {
            State::Ready(program) => Some(program),
            State::Compiling(_) => None,
        })
    }

    fn place(&self, entry: Entry, constants: &[u32]) -> Option<usize> {
        self.0.iter().position(|(e, c, _)| *e == entry && c == constants)
    }

    /// The place of a program that is there or on its way.
    fn begun(&mut self, gpu: &Gpu, entry: Entry, constants: &[u32]) -> usize {
        self.place(entry, constants).unwrap_or_else(|| {
            self.0.push((entry, constants.to_vec(), State::Compiling(compile(gpu, entry, constants))));
            self.0.len() - 1
        })
    }

    /// Keeps what a thread has made. One that failed is forgotten, so that it may be tried again.
    fn keep(&mut self, place: usize, made: Result<Program, DeviceError>) -> Result<(), DeviceError> {
        match made {
            Ok(program) => {
                self.0[place].2 = State::Ready(program);
                Ok(())
            }
            Err(error) => {
                self.0.remove(place);
                Err(error)
            }
        }
    }

    /// Keeps what threads have made that nobody asks for now. A failure is met by whoever asks next.
    fn collect(&mut self) {
        self.0.retain_mut(|(_, _, state)| {
            let State::Compiling(made) = state else { return true };
            match made.try_recv() {
                Ok(Ok(program)) => *state = State::Ready(program),
                Err(TryRecvError::Empty) => {}
                Ok(Err(_)) | Err(TryRecvError::Disconnected) => return false,
            }
            true
        });
    }
}

/// What a thread that panicked leaves behind.
fn ended() -> DeviceError {
    DeviceError::Lost("compiling shaders")
}

/// Has the driver compile in a thread; where none can be started, in this one.
fn compile(gpu: &Gpu, entry: Entry, constants: &[u32]) -> Receiver<Result<Program, DeviceError>> {
    let (send, made) = channel();
    let mark = UnderWay::begin();
    let work = {
        let (gpu, constants, send) = (gpu.clone(), constants.to_vec(), send.clone());
        move || {
            let made = gpu.compiling(|| program(&gpu, entry, &constants));
            gpu.save_pipelines();
            // Nobody listens any more where the renderer is gone. The device goes before the mark does.
            drop((send.send(made), send, gpu));
            drop(mark);
        }
    };
    let thread = std::thread::Builder::new().name("pumice-compiler".into()).stack_size(STACK_BYTES);
    if thread.spawn(work).is_err() {
        let _mark = UnderWay::begin();
        let _ = send.send(gpu.compiling(|| program(gpu, entry, constants)));
        gpu.save_pipelines();
    }
    made
}

/// Compilations in progress, and the process that they are in: one that is forked from it has none.
struct Count {
    process: u32,
    under_way: usize,
}

static COUNT: Mutex<Count> = Mutex::new(Count { process: 0, under_way: 0 });
static ENDED: Condvar = Condvar::new();

fn count() -> MutexGuard<'static, Count> {
    COUNT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Counts a compilation until it is dropped.
struct UnderWay;

impl UnderWay {
    fn begin() -> Self {
        let mut count = count();
        (count.process, count.under_way) = (std::process::id(), count.under_way + 1);
        Self
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        count().under_way -= 1;
        ENDED.notify_all();
    }
}

/// Waits until all compilations of the process have ended, at most so long; returns whether they have. To be called before the process ends, which
/// is then not taken for one that its compilers ended. Where some have not, a normal end may crash.
pub fn finish_compiling(most: Duration) -> bool {
    let end = Instant::now() + most;
    let mut count = count();
    while count.under_way > 0 && count.process == std::process::id() {
        let Some(time) = end.checked_duration_since(Instant::now()).filter(|time| !time.is_zero()) else {
            abandon_compiling();
            return false;
        };
        count = ENDED.wait_timeout(count, time).unwrap_or_else(PoisonError::into_inner).0;
    }
    true
}
