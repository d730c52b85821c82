/* frame.h -- messages of the firmloop line: COBS blocks between zero bytes, closed by a CRC-32
 *
 * message = type u8, sequence u8, payload, CRC-32 of all before it; numbers are little-endian. The CRC may go on from
 * that of other bytes which are not sent, so that only who knows them takes the message for one.
 * On the line: COBS(message with every byte xor 0x5A), 0x00; the xor makes zero bytes rare. The host's half is
 * verify/links/frame.py of firmloop.
 */
#ifndef FIRMLOOP_FRAME_H
#define FIRMLOOP_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FRAME_HEADER 2U  /* bytes: type, sequence */
#define FRAME_TRAILER 4U /* bytes: CRC-32 */
#define FRAME_MASK 0x5AU

/** Bytes by which COBS lengthens `count` bytes at most: one for every started block of 254, one for the last block. */
#define FRAME_STUFFING(count) ((count) / 254U + 1U)

/** Where a message is written before frame_seal() stuffs it in place: the output never overtakes the input. */
#define FRAME_HEADROOM(payload) FRAME_STUFFING((payload) + FRAME_HEADER + FRAME_TRAILER)

/** Bytes of a whole frame, its zero byte included. */
#define FRAME_ROOM(payload) (FRAME_HEADROOM(payload) + FRAME_HEADER + (payload) + FRAME_TRAILER + 1U)

/** One decoded message; `payload` points into the frame it came in. */
typedef struct {
    uint8_t type;
    uint8_t sequence;
    size_t length; /**< bytes of payload */
    uint32_t crc;  /**< that it came with */
    const uint8_t *payload;
} fl_message_t;

/** The place of the first zero byte from `begin` on, `end` if there is none before it. */
size_t frame_find_zero(const uint8_t *bytes, size_t begin, size_t end);

/** CRC-32 (IEEE 802.3, reflected 0xEDB88320, as in zlib) of the bytes before, whose own is `crc` (0 for none), and of
 * these. */
uint32_t frame_crc32(uint32_t crc, const uint8_t *bytes, size_t count);

/** Masks and stuffs `count` bytes into `block` and returns how many it became; `block` may lie FRAME_STUFFING before
 * `bytes`. */
size_t frame_stuff(const uint8_t *bytes, size_t count, uint8_t *block);

/** Undoes frame_stuff() in place; returns the bytes left, or SIZE_MAX if the block is not well formed. */
size_t frame_unstuff(uint8_t *block, size_t count);

/** Decodes the block in place; false if it cannot be one. Whether it is whole, frame_whole() tells. */
bool frame_open(uint8_t *block, size_t count, fl_message_t *message);

/** Whether the message came with the CRC that its bytes have, gone on from `bound`. */
bool frame_whole(const fl_message_t *message, uint32_t bound);

/** Closes the message whose payload of `length` bytes begins at frame + headroom + FRAME_HEADER with a CRC gone on from
 * `bound`; returns the bytes to send, which begin at `frame`. */
size_t frame_seal(uint8_t *frame, size_t headroom, uint8_t type, uint8_t sequence, size_t length, uint32_t bound);

#endif
