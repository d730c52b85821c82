/* board.h -- what main.c needs of a board: start.c, one startup, one timer, one transport, and a UART if the transport is one
 *
 * A new UART family is one file that defines the four functions of uart_*.c, and a wait_*.c if images shall sleep on
 * it; a new board is one TOML file of firmloop.
 */
#ifndef FIRMLOOP_BOARD_H
#define FIRMLOOP_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** One register of the board to change before anything else: value = (value & ~clear) | set, if either names a bit;
 * then wait until the bits of `wait` are set. */
typedef struct {
    uint32_t address;
    uint32_t clear;
    uint32_t set;
    uint32_t wait;
} fl_write_t;

/* setup.c, where the target has registers to write */
void board_setup(void);

/* transport_*.c */
void transport_open(void);
/** Waits until bytes are there; returns how many it took, at most `room`. Ends the image when the host has gone. */
size_t transport_read(uint8_t *bytes, size_t room);
void transport_write(const uint8_t *bytes, size_t count);
/** A text for a person who watches the line; used by the fault report only. */
void transport_text(const char *text);
/** Ends the image as a failure, or stays still where nothing can end it. */
void transport_fail(void);

/* timer_*.c */
void timer_start(void);
/** The reading that a measurement begins with; a narrow counter starts anew, so only one measurement runs at a time. */
uint32_t timer_begin(void);
/** Counts up, BOARD_TIMER_MASK wide. */
uint32_t timer_now(void);

/* uart_*.c */
void uart_start(void);
/** Waits until the transmitter takes the byte. */
void uart_put(uint8_t byte);
/** Whether uart_put() would not wait. */
bool uart_ready(void);
/** The next byte, or -1 if none has come. */
int32_t uart_get(void);

/* wait_*.c */
/** After uart_get() found none: sleeps until a byte may have come since, or does not sleep at all. */
void uart_wait(void);

/* The user's own, with the UART driver `user` */
bool board_putc(uint8_t byte);
int board_getc(void);

/* start.c */
/** Makes the memory what C expects it to be and runs main(); the first function of C there is. */
void start_c(void);
/** A name and eight hex digits; used by the fault report only. */
void say_register(const char *name, uint32_t value);
void *memcpy(void *to, const void *from, size_t count);
void *memset(void *to, int value, size_t count);

/* startup_*.c */
/** Of a timer that has one; otherwise it is a fault. */
void systick_handler(void);
/** Asks what stands in for the board for an operation of semihosting. */
uint32_t semihosting_call(uint32_t operation, uint32_t argument);
/** Has this interrupt be no longer pending, unless it is raised. */
void interrupt_clear(uint32_t interrupt);
/** Sleeps until this interrupt is pending, be it already, or another event wakes the core; no handler of it runs. */
void interrupt_wait(uint32_t interrupt);
/** Fills the stack below the caller with a pattern, at most so many bytes of it, a multiple of 4. */
void stack_paint(uint32_t most);
/** Bytes below the caller that were written since stack_paint(), as far as the `most` bytes below the caller tell. */
uint32_t stack_depth(uint32_t most);

#endif
