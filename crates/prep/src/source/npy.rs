//! A NumPy array of whole numbers along one axis (`.npy`, versions 1 to 3).
//!
//! The format's own reader (numpy/lib/format.py) evaluates the header as a Python expression. Here nothing is followed:
//! a header is the three keys that NumPy writes, each once, or it is refused; and a file holds its numbers and no more.

/// Largest header: NumPy's own are below 200 bytes.
pub(crate) const MAX_HEADER_BYTES: usize = 4096;
/// Bytes before the header at most: magic word, version, its length.
pub(crate) const MAX_PREFIX_BYTES: usize = 12;
/// The widest whole number, in bytes.
pub(crate) const MAX_NUMBER_BYTES: usize = 8;

/// What a header says.
#[derive(Debug, PartialEq, Eq)]
struct Header {
    /// As in `<i8`.
    descr: String,
    shape: Vec<u64>,
}

/// The numbers of an array with at most one axis that is not 1: (N,), (N, 1) or (1, N). Those above 2^63 come back as
/// their negative complements. In words what is wrong with any other.
pub(crate) fn whole_numbers(bytes: &[u8]) -> Result<Vec<i64>, String> {
    let (header, data) = split(bytes)?;
    let header = Words(header).header().ok_or("its header is none that NumPy writes for an array of whole numbers")?;
    let count = length(&header.shape)?;
    let (big_endian, signed, width) = number_type(&header.descr)?;
    let expected = count.checked_mul(width as u64).ok_or("more numbers than there can be")?;
    if (data.len() as u64) < expected {
        return Err(format!("it ends early: {} bytes of numbers, expected {expected}", data.len()));
    }
    if data.len() as u64 > expected {
        return Err(format!("{} bytes behind its numbers, expected none", data.len() as u64 - expected));
    }
    Ok(data.chunks_exact(width).map(|number| whole_number(number, big_endian, signed)).collect())
}

/// The header's text and what follows it.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let cut_off = || "no NumPy array: it is too short".to_owned();
    if bytes.get(..6).ok_or_else(cut_off)? != b"\x93NUMPY" {
        return Err("no NumPy array: it does not begin as one".to_owned());
    }
    let from = match bytes.get(6).ok_or_else(cut_off)? {
        1 => 10,
        2 | 3 => 12,
        version => return Err(format!("a NumPy array of version {version}; expected 1, 2 or 3")),
    };
    let length = bytes.get(8..from).ok_or_else(cut_off)?;
    let length = length.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    if length > MAX_HEADER_BYTES {
        return Err(format!("its header is {length} bytes long; expected at most {MAX_HEADER_BYTES}"));
    }
    bytes[from..].split_at_checked(length).ok_or_else(|| "no NumPy array: its header is cut off".to_owned())
}

/// The length of its one axis that is not 1. With two of them the order of the numbers would be anybody's guess.
fn length(shape: &[u64]) -> Result<u64, String> {
    match shape {
        [count] | [count, 1] | [1, count] => Ok(*count),
        _ => {
            let axes: Vec<String> = shape.iter().map(u64::to_string).collect();
            Err(format!("an array of shape ({}); expected (N,), (N, 1) or (1, N)", axes.join(", ")))
        }
    }
}

/// Whether it is big-endian, whether it has a sign, and its bytes.
fn number_type(descr: &str) -> Result<(bool, bool, usize), String> {
    let other = || format!("an array of '{descr}'; expected whole numbers, as in '<i8'");
    let [order, kind, width] = *descr.as_bytes() else { return Err(other()) };
    let signed = match kind {
        b'i' => true,
        b'u' => false,
        _ => return Err(other()),
    };
    match (order, width) {
        (b'|' | b'<' | b'>', b'1') => Ok((false, signed, 1)),
        (b'<' | b'>', b'2' | b'4' | b'8') => Ok((order == b'>', signed, usize::from(width - b'0'))),
        _ => Err(other()),
    }
}

fn whole_number(bytes: &[u8], big_endian: bool, signed: bool) -> i64 {
    let mut number = [0; MAX_NUMBER_BYTES];
    number[..bytes.len()].copy_from_slice(bytes);
    if big_endian {
        number[..bytes.len()].reverse();
    }
    let (number, unused) = (i64::from_le_bytes(number), 64 - 8 * bytes.len() as u32);
    // Up and down again: the sign's bit fills what is above it.
    if signed { number << unused >> unused } else { number }
}

/// What is left of a header.
struct Words<'a>(&'a [u8]);

impl Words<'_> {
    /// `{'descr': '<i8', 'fortran_order': False, 'shape': (3,), }`, the keys in any order; none for anything else.
    fn header(mut self) -> Option<Header> {
        let (mut descr, mut order, mut shape) = (None, None, None);
        self.take(b"{")?;
        for _ in 0..3 {
            let key = self.text()?;
            self.take(b":")?;
            match key.as_str() {
                "descr" if descr.is_none() => descr = Some(self.text()?),
                // Of one axis there is no other order.
                "fortran_order" if order.is_none() => order = Some(self.take(b"False").or_else(|| self.take(b"True"))?),
                "shape" if shape.is_none() => shape = Some(self.shape()?),
                _ => return None,
            }
            if self.take(b",").is_none() {
                break;
            }
        }
        self.take(b"}")?;
        self.skip_spaces();
        order?;
        self.0.is_empty().then_some(Header { descr: descr?, shape: shape? })
    }

    fn skip_spaces(&mut self) {
        self.0 = self.0.trim_ascii_start();
    }

    /// The word, and spaces before it.
    fn take(&mut self, word: &[u8]) -> Option<()> {
        self.skip_spaces();
        self.0 = self.0.strip_prefix(word)?;
        Some(())
    }

    /// What stands in quotes; without escapes, which no key and no type has.
    fn text(&mut self) -> Option<String> {
        let quote = [b"'", b"\""].into_iter().find(|quote| self.take(*quote).is_some())?;
        let end = self.0.iter().position(|byte| byte == &quote[0])?;
        let (text, rest) = self.0.split_at(end);
        self.0 = &rest[1..];
        let plain = text.iter().all(|byte| byte.is_ascii_graphic() && *byte != b'\\');
        plain.then(|| String::from_utf8_lossy(text).into_owned())
    }

    /// Decimal numbers between brackets. Python wants a comma behind a single one.
    fn shape(&mut self) -> Option<Vec<u64>> {
        let (mut axes, mut comma) = (Vec::new(), false);
        self.take(b"(")?;
        while self.take(b")").is_none() {
            if !axes.is_empty() && !comma {
                return None;
            }
            self.skip_spaces();
            let digits = self.0.iter().take_while(|byte| byte.is_ascii_digit()).count();
            let (number, rest) = self.0.split_at(digits);
            axes.push(std::str::from_utf8(number).ok()?.parse().ok()?);
            self.0 = rest;
            comma = self.take(b",").is_some();
        }
        (axes.len() != 1 || comma).then_some(axes)
    }
}

#[cfg(test)]
mod tests {
    use npyz::WriterBuilder as _;
    use proptest::prelude::*;

    use super::*;

    /// As another program writes it.
    fn npy<T: npyz::AutoSerialize + Copy>(numbers: &[T], shape: &[u64], order: npyz::Order) -> Vec<u8> {
        let mut bytes = Vec::new();
        let options = npyz::WriteOptions::new().default_dtype().shape(shape).order(order);
        let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
        writer.extend(numbers.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn with_header(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(&(header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn whole_numbers_of_any_width_come_back() {
        use npyz::Order::C;
        assert_eq!(whole_numbers(&npy(&[7_i64, -1, i64::MIN], &[3], C)).unwrap(), [7, -1, i64::MIN]);
        assert_eq!(whole_numbers(&npy(&[7_i32, -1, i32::MIN], &[3, 1], C)).unwrap(), [7, -1, i64::from(i32::MIN)]);
        assert_eq!(whole_numbers(&npy(&[7_i16, -1], &[1, 2], C)).unwrap(), [7, -1]);
        assert_eq!(whole_numbers(&npy(&[7_i8, -1], &[2], C)).unwrap(), [7, -1]);
        assert_eq!(whole_numbers(&npy(&[9_u8, 200], &[2], C)).unwrap(), [9, 200]);
        assert_eq!(whole_numbers(&npy(&[9_u16, 60_000], &[2], C)).unwrap(), [9, 60_000]);
        assert_eq!(whole_numbers(&npy(&[u64::MAX, 0], &[2], C)).unwrap(), [-1, 0]);
        assert!(whole_numbers(&npy::<i64>(&[], &[0], C)).unwrap().is_empty());
        let big = with_header("{'shape': (2,), 'fortran_order': False, 'descr': '>i2'}\n", &[0, 1, 0xff, 0xfe]);
        assert_eq!(whole_numbers(&big).unwrap(), [1, -2]);
    }

    /// In Fortran's order the numbers of two axes lie otherwise; of one axis there is no other order.
    #[test]
    fn two_axes_are_refused_in_either_order() {
        for order in [npyz::Order::C, npyz::Order::Fortran] {
            let fault = whole_numbers(&npy(&[1_i64; 6], &[2, 3], order)).unwrap_err();
            assert_eq!(fault, "an array of shape (2, 3); expected (N,), (N, 1) or (1, N)");
            assert_eq!(whole_numbers(&npy(&[5_i64, 6], &[2, 1], order)).unwrap(), [5, 6]);
        }
        for shape in [&[1, 1, 4][..], &[]] {
            whole_numbers(&npy(&[1_i64; 4][..shape.iter().product::<u64>() as usize], shape, npyz::Order::C))
                .unwrap_err();
        }
    }

    #[test]
    fn a_file_holds_its_numbers_and_no_more() {
        let mut bytes = npy(&[1_i64, 2], &[2], npyz::Order::C);
        assert!(whole_numbers(&bytes[..bytes.len() - 1]).unwrap_err().contains("it ends early"));
        bytes.push(0);
        assert_eq!(whole_numbers(&bytes).unwrap_err(), "1 bytes behind its numbers, expected none");
    }

    #[test]
    fn other_headers_are_refused() {
        let plain = "{'descr': '<i8', 'fortran_order': False, 'shape': (1,), }";
        assert_eq!(whole_numbers(&with_header(plain, &[5, 0, 0, 0, 0, 0, 0, 0])).unwrap(), [5]);
        for (from, to) in [
            // Once multiplied beyond 64 bits: a panic, or a small number.
            ("(1,)", "(0xffffffffffffffff, 0xffff)"),
            ("(1,)", "(0b1,)"),
            ("(1,)", "(1_0,)"),
            ("(1,)", "(-1,)"),
            ("(1,)", "(1)"),
            ("(1,)", "(1 1,)"),
            ("(1,)", "(,)"),
            ("(1,)", "(18446744073709551616,)"),
            ("(1,)", "(18446744073709551615,)"),
            ("(1,)", "(4294967296, 4294967296)"),
            ("False", "0"),
            ("'<i8'", "[('a', '<i8')]"),
            ("'<i8'", "'<f8'"),
            ("'<i8'", "'<i16'"),
            ("'<i8'", "'\\x3ci8'"),
            ("'fortran_order': False, ", ""),
            ("'fortran_order'", "'descr'"),
            ("}", "} {}"),
            ("{", "{{"),
        ] {
            let changed = plain.replace(from, to);
            assert_ne!(changed, plain);
            whole_numbers(&with_header(&changed, &[5, 0, 0, 0, 0, 0, 0, 0])).unwrap_err();
        }
        whole_numbers(&with_header(&"[".repeat(4000), &[])).unwrap_err();
        let mut long = b"\x93NUMPY\x02\x00".to_vec();
        long.extend(&u32::MAX.to_le_bytes());
        assert!(whole_numbers(&long).unwrap_err().contains("4294967295 bytes long"));
    }

    proptest! {
        #[test]
        fn any_bytes_are_an_answer(mut bytes in prop::collection::vec(any::<u8>(), 0..300), whole in any::<bool>()) {
            if whole {
                let sound = npy(&[1_i64; 4], &[4], npyz::Order::C);
                let noise = bytes.iter().chain(std::iter::repeat(&0));
                bytes = sound.iter().zip(noise).map(|(a, b)| a ^ (b & b >> 4)).collect();
            }
            let _ = whole_numbers(&bytes);
        }
    }
}
