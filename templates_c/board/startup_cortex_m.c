/* startup_cortex_m.c -- reset, faults, sleep and stack of any Cortex-M
 *
 * Register addresses: ARMv7-M Architecture Reference Manual (DDI 0403), B3.2 "System Control Space".
 */
#include <stdint.h>

#include "board.h"

/* Places given by the linker script; only their addresses mean anything. */
extern uint32_t stack_bottom[];
extern uint32_t stack_top[];

/* Interrupt set-enable, clear-enable and clear-pending registers, offsets from 0xE000E000. */
#define NVIC_ISER 0x100U
#define NVIC_ICER 0x180U
#define NVIC_ICPR 0x280U

typedef void (*handler_t)(void);

void reset_handler(void);
void fault_handler(void);
void fault_report(const uint32_t *frame, uint32_t exc_return);

typedef struct {
    const uint32_t *stack;
    handler_t handlers[15];
} vector_table_t;

__attribute__((section(".vectors"), used)) const vector_table_t vector_table = {
    stack_top,
    {
        reset_handler,
        fault_handler, /* NMI */
        fault_handler, /* HardFault */
        fault_handler, /* MemManage */
        fault_handler, /* BusFault */
        fault_handler, /* UsageFault */
        0,
        0,
        0,
        0,             /* reserved */
        fault_handler, /* SVCall */
        fault_handler, /* DebugMonitor */
        0,             /* reserved */
        fault_handler, /* PendSV */
        systick_handler,
    },
};

void systick_handler(void) __attribute__((weak, alias("fault_handler")));

/* The compiler may use floating-point registers in any C function, so the unit is switched on before the first one. */
__attribute__((naked, used)) void reset_handler(void) {
#if defined(__ARM_FP)
    __asm__ volatile("ldr r0, =0xE000ED88\n" /* CPACR: full access to CP10 and CP11 */
                     "ldr r1, [r0]\n"
                     "orr r1, r1, #0x00F00000\n"
                     "str r1, [r0]\n"
                     "dsb\n"
                     "isb\n");
#endif
#if !defined(__ARM_ARCH_6M__)
    /* An image that a boot loader or a debugger started may find the vectors of another one in force. */
    __asm__ volatile("ldr r0, =0xE000ED08\n" /* VTOR */
                     "ldr r1, =vector_table\n"
                     "str r1, [r0]\n"
                     "dsb\n");
#endif
    __asm__ volatile("ldr r0, =stack_top\n"
                     "mov sp, r0\n"
                     "bl start_c\n");
}

/* A stack that ran over cannot carry the report, so the report starts on a fresh one. */
__attribute__((naked, used)) void fault_handler(void) {
    __asm__ volatile("mov r0, sp\n"
                     "mov r1, lr\n"
                     "ldr r2, =stack_top\n"
                     "mov sp, r2\n"
                     "bl fault_report\n");
}

__attribute__((used, noreturn)) void fault_report(const uint32_t *frame, uint32_t exc_return) {
    const volatile uint32_t *const scb = (const volatile uint32_t *)0xE000ED00UL;
    say_register("FAULT icsr=", scb[1]);
    say_register(" cfsr=", scb[10]);
    say_register(" hfsr=", scb[11]);
    say_register(" mmfar=", scb[13]);
    say_register(" bfar=", scb[14]);
    say_register(" exc_return=", exc_return);
    say_register(" sp=", (uint32_t)(uintptr_t)frame);
    if (frame >= stack_bottom && frame + 8 <= stack_top) {
        say_register(" r0=", frame[0]);
        say_register(" r1=", frame[1]);
        say_register(" r2=", frame[2]);
        say_register(" r3=", frame[3]);
        say_register(" r12=", frame[4]);
        say_register(" lr=", frame[5]);
        say_register(" pc=", frame[6]);
        say_register(" xpsr=", frame[7]);
    } else {
        transport_text(" stack=overrun");
    }
    transport_text("\n");
    transport_fail();
    for (;;) {
    }
}

static volatile uint32_t *nvic(uint32_t registers, uint32_t interrupt) {
    return (volatile uint32_t *)(0xE000E000UL + registers + 4U * (interrupt / 32U));
}

void interrupt_clear(uint32_t interrupt) {
    *nvic(NVIC_ICPR, interrupt) = 1UL << (interrupt % 32U);
}

/* PRIMASK keeps the handler from running, of which there is none, but not the interrupt from waking the core (DDI 0403,
 * B1.5 "Wait For Interrupt"). What came before stays pending and ends the sleep at once. */
void interrupt_wait(uint32_t interrupt) {
    const uint32_t bit = 1UL << (interrupt % 32U);
    __asm__ volatile("cpsid i" ::: "memory");
    *nvic(NVIC_ISER, interrupt) = bit;
    __asm__ volatile("dsb" ::: "memory");
    __asm__ volatile("wfi" ::: "memory");
    *nvic(NVIC_ICER, interrupt) = bit;
    __asm__ volatile("dsb" ::: "memory");
    __asm__ volatile("isb" ::: "memory");
    __asm__ volatile("cpsie i" ::: "memory");
}

uint32_t semihosting_call(uint32_t operation, uint32_t argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* In assembly because both have to know that they put nothing of their own below the caller's stack pointer; a compiler
 * may save a register there, as it does on ARMv8.1-M to count a loop. */
__attribute__((naked)) void stack_paint(uint32_t most) {
    (void)most; /* r0 */
    __asm__ volatile(".syntax unified\n"
                     "ldr r2, =stack_bottom\n"
                     "mov r1, sp\n"
                     "subs r3, r1, r2\n"
                     "cmp r3, r0\n"
                     "bls 3f\n"
                     "subs r2, r1, r0\n"
                     "3: ldr r3, =0xA5C35A3C\n"
                     "1: cmp r2, r1\n"
                     "bhs 2f\n"
                     "str r3, [r2]\n"
                     "adds r2, r2, #4\n"
                     "b 1b\n"
                     "2: bx lr\n");
}

__attribute__((naked)) uint32_t stack_depth(uint32_t most) {
    (void)most; /* r0 */
    __asm__ volatile(".syntax unified\n"
                     "ldr r1, =stack_bottom\n"
                     "mov r2, sp\n"
                     "subs r3, r2, r1\n"
                     "cmp r3, r0\n"
                     "bls 3f\n"
                     "subs r1, r2, r0\n"
                     "3: ldr r3, =0xA5C35A3C\n"
                     "1: cmp r1, r2\n"
                     "bhs 2f\n"
                     "ldr r0, [r1]\n"
                     "cmp r0, r3\n"
                     "bne 2f\n"
                     "adds r1, r1, #4\n"
                     "b 1b\n"
                     "2: subs r0, r2, r1\n"
                     "bx lr\n");
}
