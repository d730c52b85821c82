/* transport_semihosting.c -- the line is two pipes of the host, opened through semihosting
 *
 * Operations: Arm "Semihosting for AArch32 and AArch64", chapter 6; RISC-V has the same ones. The pipes are named
 * relative to the folder that the emulator runs in.
 */
#include "board.h"

#define SYS_OPEN 0x01U
#define SYS_WRITE0 0x04U
#define SYS_WRITE 0x05U
#define SYS_READ 0x06U
#define SYS_EXIT 0x18U

#define UNHEARD_MOST 4096U /* reads of nothing in a row, some ms, before a look whether anybody is there */

#define MODE_RB 1U
#define MODE_WB 5U

#define EXIT_DONE 0x20026U  /* ADP_Stopped_ApplicationExit: the emulator ends with status 0 */
#define EXIT_FAULT 0x20023U /* ADP_Stopped_RunTimeErrorUnknown: status 1 */

static uint32_t input;
static uint32_t output;

static uint32_t address_of(const volatile void *object) {
    return (uint32_t)(uintptr_t)object;
}

static void end(uint32_t reason) {
    (void)semihosting_call(SYS_EXIT, reason);
    for (;;) {
    }
}

static uint32_t open_pipe(const char *name, uint32_t length, uint32_t mode) {
    const volatile uint32_t block[3] = {address_of(name), mode, length};
    const uint32_t handle = semihosting_call(SYS_OPEN, address_of(block));
    if (handle == 0xFFFFFFFFUL) {
        transport_text("FAULT cannot open ");
        transport_text(name);
        transport_text("\n");
        transport_fail();
    }
    return handle;
}

void transport_open(void) {
    static const char to_target[] = "to_target";
    static const char to_host[] = "to_host";
    input = open_pipe(to_target, sizeof to_target - 1U, MODE_RB);
    output = open_pipe(to_host, sizeof to_host - 1U, MODE_WB);
}

/* A read of nothing may be the end of the pipe, or the host has made the pipe one that does not wait. Which of them,
 * the emulator does not tell; but a zero byte, which between frames means nothing, can be sent only to a host that is
 * there. */
size_t transport_read(uint8_t *bytes, size_t room) {
    static const uint8_t zero = 0U;
    const volatile uint32_t block[3] = {input, address_of(bytes), (uint32_t)room};
    uint32_t missing = semihosting_call(SYS_READ, address_of(block));
    for (uint32_t unheard = 1U; missing >= room; unheard++) {
        if (unheard % UNHEARD_MOST == 0U) {
            transport_write(&zero, 1U);
        }
        missing = semihosting_call(SYS_READ, address_of(block));
    }
    return room - missing;
}

void transport_write(const uint8_t *bytes, size_t count) {
    size_t left = count;
    while (left > 0U) {
        const volatile uint32_t block[3] = {output, address_of(bytes + (count - left)), (uint32_t)left};
        const uint32_t missing = semihosting_call(SYS_WRITE, address_of(block));
        if (missing >= left) {
            end(EXIT_DONE);
        }
        left = missing;
    }
}

void transport_text(const char *text) {
    (void)semihosting_call(SYS_WRITE0, address_of(text));
}

void transport_fail(void) {
    end(EXIT_FAULT);
}
