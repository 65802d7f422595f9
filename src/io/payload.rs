//! The bytes of one array in VTK's XML formats: `[size] values` or, compressed, `[blocks, block size, size of a last
//! shorter block, compressed sizes…] blocks`, either bare or in base64.
//!
//! Sizes in a file are claims. Each is checked against the bytes that are there before memory is reserved for it.

use super::broken;
use super::data::{Fault, Found};
use super::element::Element;
use crate::error::{Error, Result};
use crate::memory;
use std::borrow::Cow;
use std::io::{self, Read};

/// How a file stores its binary arrays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Bytes of a size: 4 (UInt32) or 8 (UInt64).
    pub word: usize,
    /// The file's byte order is not this machine's.
    pub swapped: bool,
    pub compressor: Option<Compressor>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Compressor {
    Zlib,
    Lz4,
    /// Known by name alone: files in digits have it too.
    Lzma,
}

impl Layout {
    /// The most values, in bytes, that so many bytes of a file can hold.
    pub fn capacity(&self, bytes: u64) -> u64 {
        bytes.saturating_mul(self.compressor.map_or(1, Compressor::best_ratio))
    }
}

impl Compressor {
    /// The most that a byte can unfold into: deflate codes 258 bytes in two bits, lz4 255 bytes in one byte.
    fn best_ratio(self) -> u64 {
        match self {
            Compressor::Zlib => 1032,
            Compressor::Lz4 => 255,
            Compressor::Lzma => 1,
        }
    }

    fn unpack(self, packed: &[u8], block: &mut [u8]) -> Result<()> {
        let whole = match self {
            Compressor::Zlib => inflate(packed, block).is_ok(),
            Compressor::Lzma => {
                return Err(broken("compressor LZMA is not supported; re-save the file with zlib or lz4"));
            }
            Compressor::Lz4 => lz4_flex::block::decompress_into(packed, block).is_ok_and(|n| n == block.len()),
        };
        whole
            .then_some(())
            .ok_or_else(|| broken("a compressed block does not unpack to the size that the file gives it"))
    }
}

fn inflate(packed: &[u8], block: &mut [u8]) -> io::Result<()> {
    let mut unpacked = flate2::read::ZlibDecoder::new(packed);
    unpacked.read_exact(block)?;
    // The end is part of it: there the checksum is compared.
    match unpacked.read(&mut [0])? {
        0 => Ok(()),
        _ => Err(io::ErrorKind::InvalidData.into()),
    }
}

/// Where the bytes of an array come from, and how many there can be at most.
pub struct Payload<'a> {
    source: Box<dyn Read + 'a>,
    left: u64,
}

impl<'a> Payload<'a> {
    /// Bare bytes, at most `left` of them.
    pub fn bare(source: impl Read + 'a, left: u64) -> Payload<'a> {
        Payload { source: Box::new(source), left }
    }

    /// Bytes in base64; what follows the array is not looked at.
    pub fn base64(text: &'a [u8]) -> Payload<'a> {
        let left = text.len() as u64 / 4 * 3;
        Payload { source: Box::new(Base64 { text, bytes: Vec::new(), at: 0 }), left }
    }

    /// The `count` values of an array.
    pub fn values<T: Element>(self, layout: &Layout, count: usize) -> Found<Vec<T>> {
        // Some writers give an empty array no bytes at all, not even its size.
        if count == 0 { Ok(Vec::new()) } else { self.decode(layout, Some(count)) }
    }

    /// All bytes of an array of text, whose length only its own size tells.
    pub fn text(self, layout: &Layout) -> Found<Vec<u8>> {
        self.decode(layout, None)
    }

    fn decode<T: Element>(mut self, layout: &Layout, count: Option<usize>) -> Found<Vec<T>> {
        let mut values = match layout.compressor {
            None => self.plain(layout, count)?,
            Some(Compressor::Lzma) => Compressor::Lzma.unpack(&[], &mut []).map(|()| Vec::new())?,
            Some(compressor) => self.blocks(layout, compressor, count)?,
        };
        if layout.swapped {
            bytemuck::cast_slice_mut(&mut values).chunks_exact_mut(size_of::<T>()).for_each(<[u8]>::reverse);
        }
        Ok(values)
    }

    fn plain<T: Element>(&mut self, layout: &Layout, count: Option<usize>) -> Found<Vec<T>> {
        let bytes = self.words(layout, 1)?[0];
        let count = check_count::<T>(Some(bytes), count, "")?;
        self.has(bytes)?;
        let mut values = zeroed(count)?;
        self.fill(bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    fn blocks<T: Element>(&mut self, layout: &Layout, compressor: Compressor, count: Option<usize>) -> Found<Vec<T>> {
        let head = self.words(layout, 3)?;
        let (blocks, size, last) = (head[0], head[1], head[2]);
        let full = if last == 0 { blocks } else { blocks.saturating_sub(1) };
        let bytes = full.checked_mul(size).and_then(|b| b.checked_add(last)).filter(|_| last <= size);
        let claim = format!(" ({blocks} blocks of {size}, the last of {last})");
        let count = check_count::<T>(bytes, count, &claim)?;
        let bytes = (count * size_of::<T>()) as u64;
        let packed_sizes = self.words(layout, blocks)?;
        let packed = packed_sizes.iter().try_fold(0u64, |sum, &s| sum.checked_add(s)).unwrap_or(u64::MAX);
        self.has(packed)?;
        if bytes > layout.capacity(packed) {
            return Err(broken(format!("{packed} bytes cannot unpack to {bytes}")).into());
        }
        let mut values = zeroed(count)?;
        let mut rest: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        let mut block = Vec::new();
        for packed_size in packed_sizes {
            resize(&mut block, packed_size)?;
            self.fill(&mut block)?;
            let (here, after) = rest.split_at_mut(rest.len().min(size as usize));
            compressor.unpack(&block, here)?;
            rest = after;
        }
        Ok(values)
    }

    fn words(&mut self, layout: &Layout, count: u64) -> Result<Vec<u64>> {
        self.has(count.saturating_mul(layout.word as u64))?;
        let mut bytes = Vec::new();
        resize(&mut bytes, count * layout.word as u64)?;
        self.fill(&mut bytes)?;
        let number = |word: &mut [u8]| {
            if layout.swapped {
                word.reverse();
            }
            let mut wide = [0; 8];
            let place = if cfg!(target_endian = "little") { 0 } else { 8 - word.len() };
            wide[place..place + word.len()].copy_from_slice(word);
            u64::from_ne_bytes(wide)
        };
        memory::collected("the block sizes of an array", bytes.chunks_exact_mut(layout.word).map(number))
    }

    fn has(&self, bytes: u64) -> Result<()> {
        if bytes > self.left {
            return Err(broken(format!("an array claims {bytes} bytes, at most {} are there", self.left)));
        }
        Ok(())
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.left = self.left.saturating_sub(bytes.len() as u64);
        self.source.read_exact(bytes).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => broken("an array ends early"),
            io::ErrorKind::InvalidData => broken("an array is not base64"),
            _ => Error::Io { path: String::new(), reason: e.to_string() },
        })
    }
}

/// The number of values in so many stored bytes, which must be the number expected, if one is.
fn check_count<T>(stored: Option<u64>, expected: Option<usize>, claim: &str) -> Found<usize> {
    let size = size_of::<T>() as u64;
    let count = stored.filter(|b| b % size == 0).and_then(|b| usize::try_from(b / size).ok());
    match (count, expected) {
        (Some(count), None) => Ok(count),
        (Some(count), Some(expected)) if count == expected => Ok(count),
        _ => {
            let stored = stored.map_or("an impossible number of".into(), |b| b.to_string());
            let wanted = expected.map_or(String::new(), |n| format!(" where {n} values of {size} are expected"));
            Err(Fault::Unfit(format!("it has {stored} bytes{claim}{wanted}")))
        }
    }
}

/// Zeros that the system need not touch before the file's bytes replace them.
fn zeroed<T: Element>(count: usize) -> Result<Vec<T>> {
    let zeros = bytemuck::allocation::try_zeroed_slice_box(count);
    zeros.map(<[T]>::into_vec).map_err(|()| memory::no_memory::<T>("an array of the file", count))
}

fn resize(bytes: &mut Vec<u8>, size: u64) -> Result<()> {
    let size = usize::try_from(size).map_err(|_| broken("a block is larger than this machine's memory"))?;
    bytes.clear();
    bytes.try_reserve(size).map_err(|_| memory::no_memory::<u8>("a block of the file", size))?;
    bytes.resize(size, 0);
    Ok(())
}

/// Decodes base64 with white space in it, and on after a padding: writers pad the sizes apart from the values.
struct Base64<'a> {
    text: &'a [u8],
    bytes: Vec<u8>,
    at: usize,
}

/// Characters decoded at once.
const CHARACTERS: usize = 1 << 15;

impl<'a> Base64<'a> {
    fn refill(&mut self) -> io::Result<()> {
        let (now, later) = self.text.split_at(self.text.len().min(CHARACTERS));
        // Folded, not `any`: the loop without a way out is the one that compilers make wide.
        let spaced = now.iter().fold(false, |found, c| found | (*c <= b' '));
        let (characters, later) = if spaced { self.without_spaces() } else { (Cow::Borrowed(now), later) };
        self.text = later;
        self.bytes.clear();
        self.at = 0;
        let mut rest = &characters[..];
        while !rest.is_empty() {
            let padding = if rest.contains(&b'=') { rest.iter().position(|&c| c == b'=') } else { None };
            let end = padding.map_or(rest.len(), |i| (i / 4 + 1) * 4);
            let (segment, after) = rest.split_at_checked(end).ok_or(io::ErrorKind::UnexpectedEof)?;
            let decoded = base64_simd::STANDARD.decode_append(segment, &mut self.bytes);
            decoded.map_err(|_| io::ErrorKind::InvalidData)?;
            rest = after;
        }
        Ok(())
    }

    /// The next characters that are not white space, and the text after them.
    fn without_spaces(&self) -> (Cow<'a, [u8]>, &'a [u8]) {
        let (mut characters, mut rest) = (Vec::with_capacity(CHARACTERS), self.text);
        while characters.len() < CHARACTERS && !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min(CHARACTERS - characters.len()));
            characters.extend(now.iter().filter(|c| !c.is_ascii_whitespace()));
            rest = later;
        }
        (characters.into(), rest)
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.bytes.len() {
            self.refill()?;
        }
        let ready = &self.bytes[self.at..];
        let n = ready.len().min(out.len());
        out[..n].copy_from_slice(&ready[..n]);
        self.at += n;
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BARE: Layout = Layout { word: 4, swapped: cfg!(target_endian = "big"), compressor: None };
    const ZLIB: Layout = Layout { compressor: Some(Compressor::Zlib), ..BARE };

    fn of<T: Element>(layout: &Layout, bytes: &[u8], count: usize) -> Result<Vec<T>> {
        Payload::bare(bytes, bytes.len() as u64).values(layout, count).map_err(Fault::error)
    }

    #[test]
    fn sizes_and_values_may_be_padded_apart_or_together() {
        for text in ["BAAAAAECAwQ=", "BAAAAA==AQIDBA==", " BAAA\n AAECA wQ= "] {
            assert_eq!(Payload::base64(text.as_bytes()).values::<u8>(&BARE, 4).unwrap(), [1, 2, 3, 4], "{text}");
        }
        for text in ["", "BAAAAAECA", "BAAAAA==AQIDB===", "BAA?AAECAwQ=", "====", "BAAAAAECAwQ"] {
            let error = Payload::base64(text.as_bytes()).values::<u8>(&BARE, 4).unwrap_err().error();
            assert_eq!(error.name(), "BAD_FILE", "{text}");
        }
    }

    #[test]
    fn long_base64_decodes_across_its_chunks() {
        let values: Vec<u8> = (0..100_001u64).map(|i| ((i * i) >> 3) as u8).collect();
        let text = [&100_001u32.to_le_bytes()[..], &values].concat();
        let text = base64_simd::STANDARD.encode_to_string(text);
        let wrapped: Vec<u8> = text.as_bytes().chunks(76).flat_map(|line| [line, b"\r\n"].concat()).collect();
        assert!(Payload::base64(&wrapped).values::<u8>(&BARE, 100_001).unwrap() == values);
    }

    #[test]
    fn forged_sizes_are_refused_before_memory_is_reserved() {
        let huge = 1usize << 44; // 128 TiB of doubles: reserving it would fail with another error
        let claim = |words: &[u64]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let bare = Layout { word: 8, ..BARE };
        let zlib = Layout { word: 8, ..ZLIB };
        let bytes = 8 * huge as u64;
        let cases = [
            (bare, claim(&[bytes, 0])),
            (bare, claim(&[u64::MAX])),
            (zlib, claim(&[1, bytes, 0, 8, 0])),
            (zlib, claim(&[1, bytes, 0, u64::MAX, 0])),
            (zlib, claim(&[bytes, 1, 0, 0])),
            (zlib, claim(&[2, bytes, bytes, 0])),
            (zlib, claim(&[u64::MAX, u64::MAX, 0])),
        ];
        for (layout, file) in cases {
            let error = of::<f64>(&layout, &file, huge).unwrap_err();
            assert_eq!(error.name(), "BAD_FILE", "{error}");
        }
        assert_eq!(of::<f64>(&bare, &claim(&[8]), usize::MAX).unwrap_err().name(), "BAD_FILE");
    }

    #[test]
    fn a_block_must_unpack_to_its_size_and_match_its_checksum() {
        use std::io::Write;
        let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        packer.write_all(&[7; 100]).unwrap();
        let packed = packer.finish().unwrap();
        let file = |size: u32, packed: &[u8]| {
            let head = [1, size, 0, packed.len() as u32].map(u32::to_le_bytes).concat();
            [&head[..], packed].concat()
        };
        assert_eq!(of::<u8>(&ZLIB, &file(100, &packed), 100).unwrap(), [7; 100]);
        for size in [99, 101] {
            assert!(of::<u8>(&ZLIB, &file(size, &packed), size as usize).is_err());
        }
        for i in 0..packed.len() {
            assert!(of::<u8>(&ZLIB, &file(100, &packed[..i]), 100).is_err(), "cut at {i}");
        }
        let mut spoilt = packed.clone();
        *spoilt.last_mut().unwrap() ^= 1;
        assert!(of::<u8>(&ZLIB, &file(100, &spoilt), 100).is_err());
    }
}
