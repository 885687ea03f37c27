//! Reads files of stores by HTTP, with the crate `ureq`.
//!
//! ```text
//! gs://bucket/name    https://storage.googleapis.com/bucket/name, or $STORAGE_EMULATOR_HOST/bucket/name
//! s3://bucket/name    https://bucket.s3.amazonaws.com/name, or $AWS_ENDPOINT_URL_S3/bucket/name, $AWS_ENDPOINT_URL/bucket/name
//! ```
//! Nobody logs in: buckets are public. What a server refuses (403) counts as absent, since buckets whose names may not be listed say that of
//! every name that they do not have. Answers 408, 429 and 5xx, broken connections and silence are asked again a few times.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{Error, ErrorKind, Read};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pumice_core::error::one_line;
use pumice_core::{CancelFlag, reserve};
use ureq::config::Config;
use ureq::http::Response;
use ureq::typestate::WithoutBody;
use ureq::unversioned::resolver::Resolver;
use ureq::unversioned::transport::Connector;
use ureq::{Agent, RequestBuilder};

use crate::bounded_decoder::Coder;
use crate::store_files::{Part, is_absent};

/// Whether this build reads from servers.
pub(crate) const IS_THERE: bool = true;

/// Largest description that is read. Consolidated metadata take some MB.
const MOST_DESCRIPTION: u64 = 64 << 20;

/// Descriptions are asked for several times while a store is opened; so long they are kept, and so many.
const KEPT_FOR: Duration = Duration::from_secs(10);
const KEPT: usize = 32;
/// Longer ones are not kept.
const MOST_KEPT_BYTES: usize = 1 << 20;

/// How long to wait before each further try.
const WAITS: [Duration; 3] =
    [Duration::from_millis(250), Duration::from_millis(1000), Duration::from_millis(3000)];

/// Redirects that are followed.
const MOST_REDIRECTS: usize = 5;

/// How long a server may be silent.
const SILENCE: Duration = Duration::from_secs(30);

/// Interval at which a thread that waits for a server polls its [`CancelFlag`].
const LOOK_UP: Duration = Duration::from_millis(50);

static AGENT: LazyLock<Agent> = LazyLock::new(|| config().new_agent());

fn config() -> Config {
    Agent::config_builder()
        .http_status_as_error(false)
        // `followed` does it: of a redirect whose own body is damaged, ureq expects an end that never came, and panics.
        .max_redirects(0)
        .max_redirects_will_error(false)
        .timeout_connect(Some(Duration::from_secs(10)))
        .timeout_recv_response(Some(SILENCE))
        .timeout_per_read(Some(SILENCE))
        .max_idle_connections_per_host(32)
        .max_idle_connections(64)
        .user_agent(concat!("pumice/", env!("CARGO_PKG_VERSION")))
        .build()
}

/// The URL by which HTTP reaches a place.
fn http_url(path: &Path) -> Result<String, Error> {
    http_url_with(path, |name| std::env::var(name).ok().filter(|value| !value.is_empty()))
}

fn http_url_with(path: &Path, variable: impl Fn(&str) -> Option<String>) -> Result<String, Error> {
    let wrong = |what: &str| Error::new(ErrorKind::InvalidInput, what.to_owned());
    let text = path.to_str().ok_or_else(|| wrong("the URL is not Unicode"))?;
    // Joining on Windows puts its own separator.
    let text = text.replace('\\', "/");
    if text.contains(['?', '#']) {
        return Err(wrong("expected a URL without ? and #: names of files are added to it"));
    }
    let endpoint = |name: &str| {
        let value = variable(name)?;
        let value = value.trim_end_matches('/');
        Some(if value.contains("://") { value.to_owned() } else { format!("http://{value}") })
    };
    let url = if let Some(rest) = text.strip_prefix("gs://") {
        let host = endpoint("STORAGE_EMULATOR_HOST");
        format!("{}/{rest}", host.as_deref().unwrap_or("https://storage.googleapis.com"))
    } else if let Some(rest) = text.strip_prefix("s3://") {
        match endpoint("AWS_ENDPOINT_URL_S3").or_else(|| endpoint("AWS_ENDPOINT_URL")) {
            Some(host) => format!("{host}/{rest}"),
            None => {
                let (bucket, key) = rest.split_once('/').unwrap_or((rest, ""));
                format!("https://{bucket}.s3.amazonaws.com/{key}")
            }
        }
    } else {
        text
    };
    Ok(escaped(&url))
}

/// A URL in which what may not stand there is %XX. What is escaped already stays.
fn escaped(url: &str) -> String {
    let mut escaped = String::with_capacity(url.len());
    for byte in url.bytes() {
        match byte {
            b'!'..=b'~' if !b"\"<>\\^`{|}".contains(&byte) => escaped.push(char::from(byte)),
            _ => escaped.push_str(&format!("%{byte:02X}")),
        }
    }
    escaped
}

thread_local! {
    /// Within [`heeding`], what tells this thread that nobody waits for the server any longer.
    static CANCELLED: RefCell<Option<CancelFlag>> = const { RefCell::new(None) };
}

/// Runs `work`, in which what this thread asks a server ends soon after the flag is set.
pub(crate) fn heeding<T>(flag: &CancelFlag, work: impl FnOnce() -> T) -> T {
    /// Puts the former flag back, also where `work` panics.
    struct Former(Option<CancelFlag>);
    impl Drop for Former {
        fn drop(&mut self) {
            CANCELLED.set(self.0.take());
        }
    }
    let _former = Former(CANCELLED.replace(Some(flag.clone())));
    work()
}

/// The answer of a server, which within [`heeding`] a thread of its own asks: a silent server may be asked for minutes, and connections cannot
/// be given up. Whoever reads voxels has threads for that.
///
/// # Errors
/// Those of `ask`; [`ErrorKind::Other`] once the flag of this thread is set ([`heeding`]), and the thread that asks ends by itself.
fn heard<T: Send + 'static>(ask: impl FnOnce() -> Result<T, Error> + Send + 'static) -> Result<T, Error> {
    let Some(cancelled) = CANCELLED.with_borrow(Option::clone) else { return ask() };
    let (send, answer) = channel();
    // The receiver is gone where nobody waits any longer.
    let asking = move || drop(send.send(ask()));
    std::thread::Builder::new().name("pumice-server".into()).spawn(asking)?;
    loop {
        match answer.recv_timeout(LOOK_UP) {
            Ok(answer) => return answer,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::other("the thread that asks has ended"));
            }
            Err(RecvTimeoutError::Timeout) if cancelled.is_set() => return Err(Error::other("cancelled")),
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Reads a part of a file, of at most `most` bytes.
///
/// # Errors
/// [`ErrorKind::NotFound`] where the server has no such file, or does not give it; [`ErrorKind::UnexpectedEof`] for a part beyond its end.
pub(crate) fn read(path: &Path, part: Part, most: u64) -> Result<Vec<u8>, Error> {
    if let Part::Piece { size: 0, .. } | Part::Last(0) = part {
        return Ok(Vec::new());
    }
    let url = http_url(path)?;
    heard(move || with_tries(|| read_once(&AGENT, &url, part, most)))
}

fn read_once(agent: &Agent, url: &str, part: Part, most: u64) -> Result<Vec<u8>, Failure> {
    let mut response = followed(url, |url| {
        let request = agent.get(url);
        match part {
            Part::Whole => request.header("Accept-Encoding", "gzip, br, zstd"),
            Part::From(begin) => request.header("Range", format!("bytes={begin}-")),
            Part::Piece { begin, size } => {
                let last = begin.saturating_add(size - 1);
                request.header("Range", format!("bytes={begin}-{last}"))
            }
            Part::Last(size) => request.header("Range", format!("bytes=-{size}")),
        }
    })?;
    check_status(&response, part)?;
    body(&mut response, part, most)
}

/// Bytes of a file.
///
/// # Errors
/// As [`read`].
#[cfg(feature = "zarr")]
pub(crate) fn size(path: &Path) -> Result<u64, Error> {
    let url = http_url(path)?;
    heard(move || with_tries(|| size_once(&AGENT, &url)))
}

fn size_once(agent: &Agent, url: &str) -> Result<u64, Failure> {
    let response = followed(url, |url| agent.head(url))?;
    check_status(&response, Part::Whole)?;
    let length = response.headers().get("content-length").and_then(|v| v.to_str().ok()?.parse().ok());
    length.ok_or_else(|| {
        Failure::last(ErrorKind::InvalidData, "the server does not say the file's size".into())
    })
}

/// The answer to a request, where redirects end.
fn followed(
    url: &str,
    request: impl Fn(&str) -> RequestBuilder<WithoutBody>,
) -> Result<Response<ureq::Body>, Failure> {
    let mut url = url.to_owned();
    for _ in 0..=MOST_REDIRECTS {
        let response = request(&url).call().map_err(Failure::of_transport)?;
        let location = response.headers().get("location").and_then(|v| v.to_str().ok());
        match (response.status().as_u16(), location) {
            (301 | 302 | 303 | 307 | 308, Some(location)) => url = redirected(&url, location),
            _ => return Ok(response),
        }
    }
    Err(Failure::last(
        ErrorKind::InvalidData,
        format!("the server redirects more than {MOST_REDIRECTS} times"),
    ))
}

/// Where `Location` leads from a URL: elsewhere, to another path of the server, or to a name beside the last one (RFC 3986, section 5.2, but dots
/// are left to the server).
fn redirected(from: &str, location: &str) -> String {
    let location = location.split('#').next().unwrap_or_default();
    let path_begins = from.find("://").map_or(0, |at| at + 3);
    let origin = from[path_begins..].find('/').map_or(from, |at| &from[..path_begins + at]);
    let beside = || {
        from.split('?')
            .next()
            .and_then(|path| path[path_begins..].rfind('/').map(|at| &path[..path_begins + at]))
    };
    let has_scheme = location.split_once("://").is_some_and(|(scheme, _)| !scheme.contains(['/', '?']));
    let to = if has_scheme {
        location.to_owned()
    } else if location.starts_with("//") {
        format!("{}{location}", &from[..path_begins.saturating_sub(2)])
    } else if location.starts_with('/') {
        format!("{origin}{location}")
    } else {
        format!("{}/{location}", beside().unwrap_or(origin))
    };
    escaped(&to)
}

/// Reads a file of at most `most` bytes as a whole, from byte `begin` on, a piece of `size` bytes, and its end, and asks for its size, once each,
/// over connections that take the place of the network. For the fuzz target `server_answer`.
#[doc(hidden)]
pub fn read_over(
    connector: impl Connector,
    resolver: impl Resolver,
    (begin, size, most): (u64, u64, u64),
) -> Vec<Result<Vec<u8>, Error>> {
    let agent = Agent::with_parts(config(), connector, resolver);
    let url = "http://server/store/0/0/0";
    let parts =
        [Part::Whole, Part::From(begin), Part::Piece { begin, size: size.max(1) }, Part::Last(size.max(1))];
    let read = parts.map(|part| read_once(&agent, url, part, most));
    let sizes = [size_once(&agent, url).map(|size| size.to_le_bytes().to_vec())];
    read.into_iter().chain(sizes).map(|answer| answer.map_err(|failure| failure.error)).collect()
}

/// A short file that describes a store; `None` where there is none.
///
/// # Errors
/// What a server says other than that there is no such file.
pub(crate) fn description(path: &Path) -> Result<Option<Arc<[u8]>>, Error> {
    type Known = VecDeque<(String, Instant, Option<Arc<[u8]>>)>;
    static KNOWN: Mutex<Known> = Mutex::new(VecDeque::new());
    let url = http_url(path)?;
    // Each statement under the lock leaves the list whole.
    let list = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let is_new = |since: &Instant| since.elapsed() < KEPT_FOR;
    if let Some((_, _, found)) = list().iter().find(|(of, since, _)| *of == url && is_new(since)) {
        return Ok(found.clone());
    }
    let found: Option<Arc<[u8]>> = match read(path, Part::Whole, MOST_DESCRIPTION) {
        Ok(bytes) => Some(bytes.into()),
        Err(error) if is_absent(&error) => None,
        Err(error) => return Err(error),
    };
    if found.as_ref().is_none_or(|bytes| bytes.len() <= MOST_KEPT_BYTES) {
        let mut list = list();
        list.retain(|(of, since, _)| *of != url && is_new(since));
        list.truncate(KEPT - 1);
        list.push_front((url, Instant::now(), found.clone()));
    }
    Ok(found)
}

/// An answer that is none.
struct Failure {
    error: Error,
    /// Whether the next try may go better.
    is_passing: bool,
}

impl Failure {
    fn last(kind: ErrorKind, what: String) -> Self {
        Self { error: Error::new(kind, what), is_passing: false }
    }

    fn of_transport(error: ureq::Error) -> Self {
        let is_passing = match &error {
            ureq::Error::Io(error) => error.kind() != ErrorKind::ConnectionRefused,
            ureq::Error::Timeout(_) | ureq::Error::BodyStalled => true,
            _ => false,
        };
        let what = match error {
            ureq::Error::HostNotFound => "the server's name is not known: is this machine online?".into(),
            ureq::Error::Timeout(_) => "the server does not answer".into(),
            ureq::Error::TooManyRedirects => "the server sends from one place to the next".into(),
            other => one_line(&format!("the server cannot be read: {other}")),
        };
        Self { error: Error::other(what), is_passing }
    }
}

/// Asks again where that may help.
fn with_tries<T>(mut ask: impl FnMut() -> Result<T, Failure>) -> Result<T, Error> {
    for wait in WAITS {
        match ask() {
            Ok(answer) => return Ok(answer),
            Err(failure) if !failure.is_passing => return Err(failure.error),
            Err(_) => std::thread::sleep(wait),
        }
    }
    ask().map_err(|failure| {
        let what = format!("{}, {} times", failure.error, WAITS.len() + 1);
        if failure.is_passing { Error::new(failure.error.kind(), what) } else { failure.error }
    })
}

fn check_status<B>(response: &Response<B>, part: Part) -> Result<(), Failure> {
    let status = response.status();
    let text = one_line(&format!("{} {}", status.as_u16(), status.canonical_reason().unwrap_or_default()));
    let text = text.trim_end();
    match (status.as_u16(), part) {
        (200, Part::Whole) | (206, _) => Ok(()),
        (200, _) => Err(Failure::last(
            ErrorKind::Unsupported,
            "the server sends whole files only, and parts of this one are needed (Range)".into(),
        )),
        (403 | 404 | 410, _) => {
            Err(Failure::last(ErrorKind::NotFound, format!("the server has no such file ({text})")))
        }
        (416, _) => Err(Failure::last(
            ErrorKind::UnexpectedEof,
            "the file ends before the part that is wanted".into(),
        )),
        (code, _) => Err(Failure {
            error: Error::other(format!("the server answers {text}")),
            is_passing: matches!(code, 408 | 429 | 500..),
        }),
    }
}

/// The bytes of an answer.
fn body(response: &mut Response<ureq::Body>, part: Part, most: u64) -> Result<Vec<u8>, Failure> {
    let most = match part {
        Part::Piece { size, .. } | Part::Last(size) => most.min(size),
        Part::Whole | Part::From(_) => most,
    };
    let too_long =
        || Failure::last(ErrorKind::FileTooLarge, format!("expected at most {most} bytes, got more"));
    let coder = coder_of(response)?;
    if coder.is_some() && part != Part::Whole {
        let what = "the server sends parts of a compressed file, from which nothing can be read";
        return Err(Failure::last(ErrorKind::Unsupported, what.into()));
    }
    let stated = response.body().content_length();
    if stated.is_some_and(|length| length > most) {
        return Err(too_long());
    }
    // A server may say any length: memory for more than this is taken as bytes come.
    let room = stated.unwrap_or(0).min(64 << 20) as usize;
    let mut bytes = reserve::reserved(room, "an answer of the server")
        .map_err(|error| Failure::last(ErrorKind::OutOfMemory, error.to_string()))?;
    let passing = |error: Error| {
        let what = one_line(&format!("the answer ends too soon: {error}"));
        Failure { error: Error::new(ErrorKind::UnexpectedEof, what), is_passing: true }
    };
    let read = response.body_mut().with_config().limit(u64::MAX).reader();
    read.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(passing)?;
    if bytes.len() as u64 > most {
        return Err(too_long());
    }
    if stated.is_some_and(|length| (bytes.len() as u64) < length) {
        return Err(passing(ErrorKind::UnexpectedEof.into()));
    }
    if let Part::Piece { size, .. } | Part::Last(size) = part
        && bytes.len() as u64 != size
    {
        let what = format!("the file has {} of the {size} bytes that are wanted", bytes.len());
        return Err(Failure::last(ErrorKind::UnexpectedEof, what));
    }
    match coder {
        None => Ok(bytes),
        Some(coder) => coder
            .decode(&bytes, most)
            .map_err(|what| Failure::last(ErrorKind::InvalidData, format!("the answer: {what}"))),
    }
}

/// How the content of an answer is compressed.
fn coder_of<B>(response: &Response<B>) -> Result<Option<Coder>, Failure> {
    let coding = response.headers().get("content-encoding").map_or(&b""[..], |coding| coding.as_bytes());
    Ok(Some(match coding {
        b"" | b"identity" => return Ok(None),
        b"gzip" | b"x-gzip" => Coder::Gzip,
        b"br" => Coder::Brotli,
        b"zstd" => Coder::Zstd,
        other => {
            let other = one_line(&String::from_utf8_lossy(other));
            let what = format!("the server sends the file compressed by {other}");
            return Err(Failure::last(ErrorKind::Unsupported, what));
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn redirects_lead_where_they_say() {
        for (from, location, expected) in [
            ("http://s/a/b", "https://t/c d?e=f", "https://t/c%20d?e=f"),
            ("http://s/a/b", "//t/c", "http://t/c"),
            ("https://s:81/a/b?x=/y", "/c?d=http://e", "https://s:81/c?d=http://e"),
            ("http://s/a/b?x=/y", "c#d", "http://s/a/c"),
            ("http://s/a/", "", "http://s/a/"),
            ("http://s", "c", "http://s/c"),
        ] {
            assert_eq!(redirected(from, location), expected, "{from} {location}");
        }
    }

    #[test]
    fn buckets_have_urls() {
        let url = |text: &str, variables: &[(&str, &str)]| {
            let variable =
                |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned());
            http_url_with(Path::new(text), variable).map_err(|e| e.to_string())
        };
        let google = [("STORAGE_EMULATOR_HOST", "127.0.0.1:4443/")];
        let amazon = [("AWS_ENDPOINT_URL", "https://minio"), ("AWS_ENDPOINT_URL_S3", "https://ceph")];
        for (text, variables, expected) in [
            ("gs://b/a b/info", &[][..], "https://storage.googleapis.com/b/a%20b/info"),
            ("gs://b/k", &google[..], "http://127.0.0.1:4443/b/k"),
            ("s3://b/k/0/0", &[], "https://b.s3.amazonaws.com/k/0/0"),
            ("s3://b", &[], "https://b.s3.amazonaws.com/"),
            ("s3://b/k", &amazon[..1], "https://minio/b/k"),
            ("s3://b/k", &amazon, "https://ceph/b/k"),
            ("https://s/é%20x", &amazon, "https://s/%C3%A9%20x"),
            ("https://s/a\\b", &[], "https://s/a/b"),
        ] {
            assert_eq!(url(text, variables).as_deref(), Ok(expected), "{text}");
        }
        for text in ["https://s/a?b", "gs://b/#c"] {
            assert!(url(text, &[]).unwrap_err().contains("without ? and #"));
        }
    }
}
