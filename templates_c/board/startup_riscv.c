/* startup_riscv.c -- reset, faults, sleep and stack of a 32-bit RISC-V that has the PLIC and memory protection
 *
 * Control registers and memory protection: The RISC-V Instruction Set Manual, Volume II: Privileged Architecture.
 * Interrupts: RISC-V Platform-Level Interrupt Controller Specification; its base is that of SiFive's cores. The whole
 * image runs in machine mode with interrupts off: an interrupt wakes the core, no handler of it runs.
 */
#include <stdint.h>

#include "board.h"

/* Places given by the linker script; only their addresses mean anything. */
extern uint32_t stack_bottom[];
extern uint32_t stack_top[];

/* Of hart 0 in machine mode, which is context 0. */
#define PLIC_PRIORITY ((volatile uint32_t *)0x0C000000UL)
#define PLIC_ENABLE ((volatile uint32_t *)0x0C002000UL)
#define PLIC_THRESHOLD (*(volatile uint32_t *)0x0C200000UL)
#define PLIC_CLAIM (*(volatile uint32_t *)0x0C200004UL)

void reset_handler(void);
void fault_handler(void);
void fault_report(const uint32_t *stack, uint32_t return_address);

/* What lies below the stack, which is the image's code, is locked against writing, so that a stack that runs over
 * faults: entry 1 reaches from the address of entry 0 (cfg 0: off) to its own (cfg 0x8D: locked, top of range, X, R). */
__attribute__((naked, used, section(".vectors"))) void reset_handler(void) {
    __asm__ volatile(".option arch, +zicsr\n"
                     "la t0, fault_handler\n"
                     "csrw mtvec, t0\n"
                     "la t0, reset_handler\n"
                     "srli t0, t0, 2\n"
                     "csrw pmpaddr0, t0\n"
                     "la t0, stack_bottom\n"
                     "srli t0, t0, 2\n"
                     "csrw pmpaddr1, t0\n"
                     "li t0, 0x8D00\n"
                     "csrw pmpcfg0, t0\n"
                     "la sp, stack_top\n"
                     "j start_c\n");
}

/* A stack that ran over cannot carry the report, so the report starts on a fresh one. */
__attribute__((naked, used, aligned(4))) void fault_handler(void) {
    __asm__ volatile("mv a0, sp\n"
                     "mv a1, ra\n"
                     "la sp, stack_top\n"
                     "j fault_report\n");
}

#define READ(name, into) __asm__ volatile(".option arch, +zicsr\n csrr %0, " #name : "=r"(into))

__attribute__((used, noreturn)) void fault_report(const uint32_t *stack, uint32_t return_address) {
    uint32_t mcause = 0;
    uint32_t mepc = 0;
    uint32_t mtval = 0;
    READ(mcause, mcause);
    READ(mepc, mepc);
    READ(mtval, mtval);
    say_register("FAULT mcause=", mcause);
    say_register(" mepc=", mepc);
    say_register(" mtval=", mtval);
    say_register(" ra=", return_address);
    say_register(" sp=", (uint32_t)(uintptr_t)stack);
    if (stack < stack_bottom || stack > stack_top) {
        transport_text(" stack=overrun");
    }
    transport_text("\n");
    transport_fail();
    for (;;) {
    }
}

/* A claim of what is not enabled finds nothing; its completion lets the source raise it again. */
void interrupt_clear(uint32_t interrupt) {
    PLIC_THRESHOLD = 0U;
    PLIC_PRIORITY[interrupt] = 1U;
    PLIC_ENABLE[interrupt / 32U] |= 1UL << (interrupt % 32U);
    PLIC_CLAIM = PLIC_CLAIM;
}

/* What is pending already ends the sleep at once, for interrupts are off in mstatus, but not in mie. */
void interrupt_wait(uint32_t interrupt) {
    PLIC_ENABLE[interrupt / 32U] |= 1UL << (interrupt % 32U);
    __asm__ volatile(".option arch, +zicsr\n"
                     "li t0, 0x800\n" /* MEIE: external interrupts of machine mode */
                     "csrs mie, t0\n"
                     "wfi\n"
                     "csrc mie, t0\n" ::: "t0", "memory");
}

/* The three instructions must be just these, uncompressed: RISC-V Semihosting, "Semihosting Trap Instruction Sequence". */
uint32_t semihosting_call(uint32_t operation, uint32_t argument) {
    register uint32_t a0 __asm__("a0") = operation;
    register uint32_t a1 __asm__("a1") = argument;
    __asm__ volatile(".option push\n"
                     ".option norvc\n"
                     ".balign 16\n"
                     "slli zero, zero, 0x1f\n"
                     "ebreak\n"
                     "srai zero, zero, 7\n"
                     ".option pop\n"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
    return a0;
}

/* In assembly because both have to know that they put nothing of their own below the caller's stack pointer. */
__attribute__((naked)) void stack_paint(uint32_t most) {
    (void)most; /* a0 */
    __asm__ volatile("la t0, stack_bottom\n"
                     "sub t2, sp, t0\n"
                     "bgeu a0, t2, 3f\n"
                     "sub t0, sp, a0\n"
                     "3: li t1, 0xA5C35A3C\n"
                     "1: bgeu t0, sp, 2f\n"
                     "sw t1, 0(t0)\n"
                     "addi t0, t0, 4\n"
                     "j 1b\n"
                     "2: ret\n");
}

__attribute__((naked)) uint32_t stack_depth(uint32_t most) {
    (void)most; /* a0 */
    __asm__ volatile("la t0, stack_bottom\n"
                     "sub t2, sp, t0\n"
                     "bgeu a0, t2, 3f\n"
                     "sub t0, sp, a0\n"
                     "3: li t1, 0xA5C35A3C\n"
                     "1: bgeu t0, sp, 2f\n"
                     "lw t2, 0(t0)\n"
                     "bne t2, t1, 2f\n"
                     "addi t0, t0, 4\n"
                     "j 1b\n"
                     "2: sub a0, sp, t0\n"
                     "ret\n");
}
