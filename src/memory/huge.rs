//! Pages of the memory that are large: a processor holds the addresses of some thousand pages, and where an array has
//! more it looks them up again and again.

/// Bytes of an array that is worth it: two pages of the usual size of large ones.
const LEAST: usize = 4 << 20;

/// Asks the system for large pages for an array that is not written to yet; where it has none, or takes no advice, nothing
/// changes.
pub fn advise<T>(v: &Vec<T>) {
    let (start, bytes) = (v.as_ptr() as usize, v.capacity() * size_of::<T>());
    if bytes >= LEAST {
        for_pages(start, start + bytes);
    }
}

#[cfg(target_os = "linux")]
fn for_pages(start: usize, end: usize) {
    // SAFETY: sysconf reads a number of the system.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) }.max(1) as usize;
    let (first, last) = (start.next_multiple_of(page), end - end % page);
    // SAFETY: whole pages of an array; the advice changes how memory is found, and nothing that is in it.
    unsafe { libc::madvise(first as *mut libc::c_void, last - first, libc::MADV_HUGEPAGE) };
}

#[cfg(not(target_os = "linux"))]
fn for_pages(_: usize, _: usize) {}
