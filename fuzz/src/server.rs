//! A server in memory, whose answers are the input.
//!
//! ```text
//! input    size of pieces (1 byte), begin (1), size (1), answer ▏ answer ▏ …       ▏ is the separator
//! ```
//! Each connection gets the next answer, in pieces as a network delivers them, then its end; after the last comes the first again. An answer
//! may hold several for one connection.

use std::io::{Error, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicUsize, Ordering};

use flate2::Compression;
use flate2::write::GzEncoder;
use ureq::config::Config;
use ureq::http::Uri;
use ureq::unversioned::resolver::{ResolvedSocketAddrs, Resolver};
use ureq::unversioned::transport::{
    Buffers, ConnectionDetails, Connector, LazyBuffers, NextTimeout, Transport,
};

/// Most bytes of a file that are read.
pub const MOST_BYTES: u64 = 1 << 20;

const SEPARATOR: &[u8] = b"\0\0\0";

/// What libFuzzer gives.
#[derive(Debug)]
struct Server {
    answers: Vec<Vec<u8>>,
    piece: usize,
    next: AtomicUsize,
}

/// A connection with what is left of its answer.
#[derive(Debug)]
struct Connection {
    answer: Vec<u8>,
    at: usize,
    piece: usize,
    buffers: LazyBuffers,
}

impl Connector for Server {
    type Out = Connection;

    fn connect(
        &self,
        details: &ConnectionDetails<'_>,
        _: Option<()>,
    ) -> Result<Option<Connection>, ureq::Error> {
        let answer = self.answers[self.next.fetch_add(1, Ordering::Relaxed) % self.answers.len()].clone();
        let config = details.config;
        let buffers = LazyBuffers::new(config.input_buffer_size(), config.output_buffer_size());
        Ok(Some(Connection { answer, at: 0, piece: self.piece, buffers }))
    }
}

impl Transport for Connection {
    fn buffers(&mut self) -> &mut dyn Buffers {
        &mut self.buffers
    }

    fn transmit_output(&mut self, _: usize, _: NextTimeout) -> Result<(), ureq::Error> {
        Ok(())
    }

    fn await_input(&mut self, _: NextTimeout) -> Result<bool, ureq::Error> {
        let rest = &self.answer[self.at..];
        let room = self.buffers.input_append_buf();
        let count = rest.len().min(room.len()).min(self.piece);
        room[..count].copy_from_slice(&rest[..count]);
        self.buffers.input_appended(count);
        self.at += count;
        Ok(count > 0)
    }

    fn is_open(&mut self) -> bool {
        self.at < self.answer.len()
    }

    // As over TLS, so that an answer that sends to https:// is followed.
    fn is_tls(&self) -> bool {
        true
    }
}

/// Every name is this machine's, to which nothing connects.
#[derive(Debug)]
struct Names;

impl Resolver for Names {
    fn resolve(&self, _: &Uri, _: &Config, _: NextTimeout) -> Result<ResolvedSocketAddrs, ureq::Error> {
        let mut addresses = self.empty();
        addresses.push(SocketAddr::from((Ipv4Addr::LOCALHOST, 80)));
        Ok(addresses)
    }
}

/// What reading from the server of this input gives: a file as a whole, three parts of it, and its size.
///
/// # Panics
/// When an answer has more bytes than were asked for, or an error more than one line.
pub fn outcome(input: &[u8]) -> Vec<Result<Vec<u8>, Error>> {
    let (settings, mut rest) = input.split_at(input.len().min(3));
    let setting = |i: usize| settings.get(i).copied().unwrap_or(0);
    let mut answers = Vec::new();
    while let Some(end) = rest.windows(SEPARATOR.len()).position(|some| some == SEPARATOR) {
        answers.push(rest[..end].to_vec());
        rest = &rest[end + SEPARATOR.len()..];
    }
    answers.push(rest.to_vec());
    let server = Server {
        answers,
        piece: 1 + usize::from(setting(0)) * usize::from(setting(0)),
        next: AtomicUsize::new(0),
    };
    let (begin, size) = (u64::from(setting(1)), u64::from(setting(2)).max(1));
    let read = pumice_formats::read_over(server, Names, (begin, size, MOST_BYTES));
    for (answer, most) in read.iter().zip([MOST_BYTES, MOST_BYTES, size, size, 8]) {
        match answer {
            Ok(bytes) => assert!(bytes.len() as u64 <= most, "{} of {most} bytes", bytes.len()),
            Err(error) => {
                let text = error.to_string();
                assert!(!text.contains('\n'), "expected an error of one line, got: {text}");
                assert_ne!(error.kind(), ErrorKind::OutOfMemory, "{text}");
            }
        }
    }
    read
}

/// Answers of servers of every kind.
///
/// # Panics
/// When a stream cannot be compressed in memory.
pub fn seeds() -> Vec<Vec<u8>> {
    let text = b"{\"zarr_format\": 2, \"shape\": [64, 64, 64]}".repeat(4);
    let answer = |status: &str, headers: &str, body: &[u8]| {
        [format!("HTTP/1.1 {status}\r\n{headers}\r\n").as_bytes(), body].concat()
    };
    let length = |body: &[u8]| format!("Content-Length: {}\r\n", body.len());
    let zipped = {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        std::io::Write::write_all(&mut encoder, &text).unwrap();
        encoder.finish().unwrap()
    };
    let zstd = zstd::bulk::compress(&text, 1).unwrap();
    let whole = answer("200 OK", &length(&text), &text);
    let part = answer(
        "206 Partial Content",
        &format!("{}Content-Range: bytes 4-19/64\r\n", length(&text[..16])),
        &text[..16],
    );
    let moved = |to: &str| answer("302 Found", &format!("Location: {to}\r\nContent-Length: 0\r\n"), b"");
    let encoded = |coding: &str, body: &[u8]| {
        answer("200 OK", &format!("Content-Encoding: {coding}\r\n{}", length(body)), body)
    };
    let settings = [[255u8, 4, 16], [1, 0, 1], [30, 200, 255]];
    let conversations: Vec<Vec<Vec<u8>>> = vec![
        vec![whole.clone(), part.clone()],
        vec![answer("200 OK", "", &text)],
        vec![answer(
            "200 OK",
            "Transfer-Encoding: chunked\r\n",
            b"5\r\nhello\r\n6;x=y\r\n world\r\n0\r\nTrailer: a\r\n\r\n",
        )],
        vec![encoded("gzip", &zipped), part],
        vec![
            encoded("zstd", &zstd),
            encoded("br", b"\x0b\x02\x80hello\x03"),
            encoded("identity", &text),
            encoded("deflate", &text),
        ],
        vec![moved("/elsewhere"), whole.clone()],
        vec![moved("https://other:8443/a%20b?c#d"), moved("//x"), moved("../y"), whole.clone()],
        vec![
            answer("404 Not Found", "Content-Length: 4\r\n", b"none"),
            answer("403 Forbidden", "", b""),
            answer("416 Range Not Satisfiable", "Content-Range: bytes */9\r\n", b""),
        ],
        vec![
            answer("503 Service Unavailable", "Retry-After: 1\r\n", b""),
            answer("429 Too Many Requests", "", b""),
        ],
        vec![
            answer("200 OK", "Content-Length: 18446744073709551615\r\n", b"short"),
            answer("200 OK", "Content-Length: 99\r\n", b"short"),
            answer("206 Partial Content", "Content-Length: 1\r\n", b"longer"),
        ],
        vec![
            answer("100 Continue", "", &whole),
            answer("204 No Content", "", b""),
            answer("304 Not Modified", "", b""),
        ],
    ];
    let mut seeds = Vec::new();
    for (i, conversation) in conversations.into_iter().enumerate() {
        seeds.push([&settings[i % 3][..], &conversation.join(SEPARATOR)].concat());
    }
    seeds
}
