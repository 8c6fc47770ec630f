//! Files: written whole or not at all, read up to a limit.

use std::fs::{File, Metadata};
use std::io::{Error as IoError, ErrorKind, Read, Result as IoResult, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Writes a file so that its name always stands for a whole file: the old one or the new one.
///
/// A symbolic link is followed and stays; the file it leads to is replaced, or made where there is none. A file that is replaced hands
/// its permissions on. What is no file but takes bytes (a pipe, a terminal, `/dev/null`, `/dev/stdout`) is written to.
///
/// # Errors
/// [`Error::Io`] where it cannot be written, and for a directory, a block device or a socket; an old file is then untouched.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    write(path, bytes).map_err(|source| Error::Io {
        path: path.to_owned(),
        source,
    })
}

/// Whether a file can be written, as far as that can be told beforehand: what takes long should not be lost for a wrong name.
///
/// # Errors
/// As [`write_whole`]. Nothing is written.
pub fn check_writable(path: &Path) -> Result<()> {
    let check = || match Target::of(path)? {
        Target::File(path, _) => {
            let folder = folder(&path);
            #[cfg(target_os = "linux")]
            if nameless::create(folder).is_some() {
                return Ok(());
            }
            named(folder).map(drop)
        }
        Target::Stream(_) | Target::Pipe => Ok(()),
    };
    check().map_err(|source| Error::Io {
        path: path.to_owned(),
        source,
    })
}

/// Reads a file of at most so many MiB.
///
/// # Errors
/// What the system says, or that the file is longer.
pub(crate) fn read(path: &Path, mebibytes: u64) -> IoResult<Vec<u8>> {
    let limit = mebibytes << 20;
    let mut bytes = Vec::new();
    File::open(path)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(IoError::new(
            ErrorKind::FileTooLarge,
            format!("it is longer than {mebibytes} MiB, which no such file is"),
        ));
    }
    Ok(bytes)
}

/// Reads a text of at most so many MiB.
///
/// # Errors
/// As [`read`], and for bytes that are not UTF-8.
pub(crate) fn read_text(path: &Path, mebibytes: u64) -> IoResult<String> {
    String::from_utf8(read(path, mebibytes)?)
        .map_err(|error| IoError::new(ErrorKind::InvalidData, error.utf8_error()))
}

/// Where bytes go that are written to a name.
enum Target {
    /// A standard stream, wherever that goes.
    Stream(File),
    /// Something that takes bytes one after the other.
    Pipe,
    /// A file, there or not.
    File(PathBuf, Option<Metadata>),
}

impl Target {
    fn of(path: &Path) -> IoResult<Self> {
        let old = match std::fs::metadata(path) {
            Ok(old) => Some(old),
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        if let Some(stream) = old.as_ref().and_then(open_stream) {
            return Ok(Self::Stream(stream));
        }
        match &old {
            Some(old) if old.is_dir() => Err(IoError::new(
                ErrorKind::IsADirectory,
                "this is a directory; give the name of a file",
            )),
            Some(old) if takes_bytes(old) => Ok(Self::Pipe),
            Some(old) if !old.is_file() => Err(IoError::new(
                ErrorKind::InvalidInput,
                "this is a device or a socket; give the name of a file",
            )),
            _ => Ok(Self::File(end_of_links(path)?, old)),
        }
    }
}

fn write(path: &Path, bytes: &[u8]) -> IoResult<()> {
    match Target::of(path)? {
        Target::Stream(mut stream) => stream.write_all(bytes),
        Target::Pipe => File::options().write(true).open(path)?.write_all(bytes),
        Target::File(path, old) => replace(&path, old.as_ref(), bytes),
    }
}

/// The file that a name leads to by symbolic links, whether it is there or not.
fn end_of_links(path: &Path) -> IoResult<PathBuf> {
    const MOST: usize = 40;
    let mut end = path.to_owned();
    for _ in 0..MOST {
        match std::fs::read_link(&end) {
            // A link counts from the folder it is in.
            Ok(target) => end = end.parent().unwrap_or(Path::new("")).join(target),
            Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::NotFound) => {
                return Ok(end);
            }
            Err(error) => return Err(error),
        }
    }
    Err(IoError::new(
        ErrorKind::InvalidInput,
        format!("more than {MOST} symbolic links, one behind the other"),
    ))
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn replace(path: &Path, old: Option<&Metadata>, bytes: &[u8]) -> IoResult<()> {
    let folder = folder(path);
    #[cfg(target_os = "linux")]
    if let Some(file) = nameless::create(folder) {
        fill(&file, old, bytes)?;
        return nameless::persist(&file, folder, path);
    }
    let file = named(folder)?;
    fill(file.as_file(), old, bytes)?;
    file.persist(path).map(drop).map_err(|error| error.error)
}

fn fill(mut file: &File, old: Option<&Metadata>, bytes: &[u8]) -> IoResult<()> {
    if let Some(old) = old {
        file.set_permissions(old.permissions())?;
    }
    file.write_all(bytes)?;
    file.sync_all()
}

/// Files that have no name until they are whole, so that nothing is left of one whose writer is ended, by whatever signal.
#[cfg(target_os = "linux")]
mod nameless {
    use std::fs::File;
    use std::io::Result;
    use std::os::fd::AsRawFd;
    use std::path::Path;
    use std::sync::atomic::{AtomicU64, Ordering};

    use rustix::fs::{AtFlags, CWD, Mode, OFlags, linkat, open};
    use rustix::io::Errno;

    /// A file without a name; `None` where the file system has no such thing.
    pub(super) fn create(folder: &Path) -> Option<File> {
        let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
        let file = open(folder, flags, Mode::from_raw_mode(0o666)).ok()?;
        // It gets its name by way of this folder.
        Path::new("/proc/self/fd").is_dir().then(|| file.into())
    }

    /// Gives a file its name, in the place of what has it. A name cannot be taken over by a file without one, so that it has another for
    /// a moment.
    pub(super) fn persist(file: &File, folder: &Path, path: &Path) -> Result<()> {
        static NAMES: AtomicU64 = AtomicU64::new(0);
        let source = format!("/proc/self/fd/{}", file.as_raw_fd());
        let between = loop {
            let number = NAMES.fetch_add(1, Ordering::Relaxed);
            let name = folder.join(format!(".tmp{}-{number}", std::process::id()));
            match linkat(CWD, &source, CWD, &name, AtFlags::SYMLINK_FOLLOW) {
                Ok(()) => break name,
                Err(Errno::EXIST) => {}
                Err(error) => return Err(error.into()),
            }
        };
        std::fs::rename(&between, path).inspect_err(|_| {
            let _ = std::fs::remove_file(&between);
        })
    }
}

/// A temporary file that anyone may read who may read others made here: a result is no secret.
#[cfg(unix)]
fn named(folder: &Path) -> IoResult<tempfile::NamedTempFile> {
    use std::os::unix::fs::PermissionsExt;
    tempfile::Builder::new()
        .permissions(std::fs::Permissions::from_mode(0o666))
        .tempfile_in(folder)
}

#[cfg(not(unix))]
fn named(folder: &Path) -> IoResult<tempfile::NamedTempFile> {
    tempfile::NamedTempFile::new_in(folder)
}

/// The standard stream that a name stands for, as `/dev/stdout` does, even where the stream goes to a file: replacing that file would
/// take it away from all else that is written to the stream.
#[cfg(unix)]
fn open_stream(named: &Metadata) -> Option<File> {
    use std::os::fd::AsFd;
    use std::os::unix::fs::MetadataExt;
    let (out, error) = (std::io::stdout(), std::io::stderr());
    let streams = [out.as_fd(), error.as_fd()].into_iter();
    let mut files =
        streams.filter_map(|stream| Some(File::from(stream.try_clone_to_owned().ok()?)));
    files.find(|file| {
        let same = |own: Metadata| (own.dev(), own.ino()) == (named.dev(), named.ino());
        file.metadata().is_ok_and(same)
    })
}

#[cfg(not(unix))]
fn open_stream(_: &Metadata) -> Option<File> {
    None
}

/// Whether it is a pipe or a character device.
#[cfg(unix)]
fn takes_bytes(of: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    of.file_type().is_fifo() || of.file_type().is_char_device()
}

#[cfg(not(unix))]
fn takes_bytes(_: &Metadata) -> bool {
    false
}
