//! The receive ring: memory that the kernel shares with us and writes every frame into as it arrives (PACKET_MMAP).
//!
//! In:  a socket that is not bound yet. Out: the frames in order, each with the time it was put there, without a system
//! call. RT after [`Ring::map`]: a look is one atomic load, a frame is copied once, into the caller's buffer.
//!
//! TPACKET_V2 because its reader is woken by every frame; V3 hands over blocks and wakes on a timer of milliseconds.

use std::io;
use std::mem;
use std::os::fd::{AsRawFd, OwnedFd};
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicU32, Ordering};

use super::socket::{PACKET_OUTGOING, set_option};
use super::tag::Tag;
use crate::link::Received;
use crate::link::clock::from_timespec;

/// Octets of a place in the ring: the kernel's header, some room, the longest frame.
const PLACE_LEN: usize = 2048;
/// Places of a ring at most: 64 MiB.
const PLACES_MAX: usize = 32 * 1024;
/// Where the kernel writes the `sockaddr_ll` of a frame: behind its header, which is aligned to 16.
const ADDRESS_AT: usize = mem::size_of::<libc::tpacket2_hdr>();
const _: () = assert!(ADDRESS_AT.is_multiple_of(16) && ADDRESS_AT + 20 == libc::TPACKET2_HDRLEN);

/// The mapped ring.
pub(super) struct Ring {
    memory: NonNull<u8>,
    places: usize,
    /// The place that is filled next, or is already.
    next: usize,
}

// SAFETY: the memory belongs to this value alone (and the kernel), whichever thread holds it.
unsafe impl Send for Ring {}

impl Ring {
    /// Gives the socket a ring of at least `frames` frames. On an error the socket is as it was, but for the version of
    /// the headers, which means nothing without a ring.
    pub(super) fn map(fd: &OwnedFd, frames: usize) -> Result<Ring, (&'static str, io::Error)> {
        let raw = fd.as_raw_fd();
        // SAFETY: takes a number.
        let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
        // One page a block: pages need not lie side by side, so memory in pieces is no reason to fail.
        let block = usize::try_from(page).unwrap_or(0).max(PLACE_LEN);
        let places = frames.clamp(1, PLACES_MAX).next_multiple_of(block / PLACE_LEN);
        let version = libc::tpacket_versions::TPACKET_V2 as libc::c_int;
        set_option(raw, libc::SOL_PACKET, libc::PACKET_VERSION, &version)
            .map_err(|error| ("choosing the ring's version", error))?;
        let request = libc::tpacket_req {
            tp_block_size: block as libc::c_uint,
            tp_block_nr: (places * PLACE_LEN / block) as libc::c_uint,
            tp_frame_size: PLACE_LEN as libc::c_uint,
            tp_frame_nr: places as libc::c_uint,
        };
        set_option(raw, libc::SOL_PACKET, libc::PACKET_RX_RING, &request)
            .map_err(|error| ("asking for the ring", error))?;
        // SAFETY: a new mapping at an address of the kernel's choice; length and descriptor are those of the ring.
        let memory = unsafe {
            libc::mmap(
                ptr::null_mut(),
                places * PLACE_LEN,
                libc::PROT_READ | libc::PROT_WRITE,
                libc::MAP_SHARED | libc::MAP_POPULATE,
                raw,
                0,
            )
        };
        match NonNull::new(memory.cast::<u8>()) {
            Some(memory) if memory.as_ptr().cast() != libc::MAP_FAILED => Ok(Ring {
                memory,
                places,
                next: 0,
            }),
            Some(_) | None => {
                let error = io::Error::last_os_error();
                // Without this the kernel would go on filling a ring that is not read. It cannot fail: nothing is mapped.
                // SAFETY: all-zero is a valid tpacket_req.
                let none: libc::tpacket_req = unsafe { mem::zeroed() };
                let _ = set_option(raw, libc::SOL_PACKET, libc::PACKET_RX_RING, &none);
                Err(("mapping the ring", error))
            }
        }
    }

    /// Frames that the ring holds.
    pub(super) fn capacity_frames(&self) -> usize {
        self.places
    }

    /// Takes the next frame of another station, if there is one. RT.
    pub(super) fn pop_frame(&mut self, buffer: &mut [u8]) -> Option<Received> {
        loop {
            // SAFETY: `next` is below `places`, so the place lies inside the mapping, which lives as long as `self`.
            let place = unsafe { self.memory.as_ptr().add(self.next * PLACE_LEN) };
            // SAFETY: a place begins with the status word and is aligned to 2048; the kernel writes it atomically, too.
            let status = unsafe { AtomicU32::from_ptr(place.cast()) };
            if status.load(Ordering::Acquire) & libc::TP_STATUS_USER == 0 {
                return None;
            }
            // SAFETY: the status says that the place is ours until we give it back: the kernel has written header and
            // address and does not touch them now. Both are plain numbers, aligned within the aligned place.
            let (header, from) = unsafe {
                (
                    place.cast::<libc::tpacket2_hdr>().read(),
                    place.add(ADDRESS_AT).cast::<libc::sockaddr_ll>().read(),
                )
            };
            // Kernels before 4.20 show us our own frames.
            let received = (from.sll_pkttype != PACKET_OUTGOING).then(|| {
                let at = usize::from(header.tp_mac).min(PLACE_LEN);
                let length = (header.tp_snaplen as usize).min(PLACE_LEN - at).min(buffer.len());
                // SAFETY: `at + length` is within the place, `length` within the buffer; the mapping is no part of it.
                unsafe { ptr::copy_nonoverlapping(place.add(at), buffer.as_mut_ptr(), length) };
                let tag = Tag::from_status(header.tp_status, header.tp_vlan_tpid, header.tp_vlan_tci);
                Received {
                    length: tag.map_or(length, |tag| tag.put_back(buffer, length)),
                    stamp_ns: Some(from_timespec(libc::timespec {
                        tv_sec: header.tp_sec.into(),
                        tv_nsec: header.tp_nsec.into(),
                    })),
                }
            });
            status.store(libc::TP_STATUS_KERNEL, Ordering::Release);
            self.next = (self.next + 1) % self.places;
            if received.is_some() {
                return received;
            }
        }
    }
}

impl Drop for Ring {
    fn drop(&mut self) {
        // SAFETY: address and length are those of the mapping, and nothing points into it any more.
        unsafe { libc::munmap(self.memory.as_ptr().cast(), self.places * PLACE_LEN) };
    }
}
