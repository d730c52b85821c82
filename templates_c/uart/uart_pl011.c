/* uart_pl011.c -- the Arm PrimeCell UART PL011 (DDI 0183, chapter 3), as in the RP2040 (its datasheet, section 4.2)
 *
 * Clock gates and pins are the target's setup.
 */
#include "board.h"
#include "board_config.h"

#define UARTDR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define UARTFR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x18U))
#define UARTIBRD (*(volatile uint32_t *)(BOARD_UART_BASE + 0x24U))
#define UARTFBRD (*(volatile uint32_t *)(BOARD_UART_BASE + 0x28U))
#define UARTLCR_H (*(volatile uint32_t *)(BOARD_UART_BASE + 0x2CU))
#define UARTCR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x30U))

#define FR_RXFE (1U << 4)
#define FR_TXFF (1U << 5)
#define LCR_H_8_BITS_FIFO ((3U << 5) | (1U << 4))
#define CR_UARTEN_TXE_RXE ((1U << 0) | (1U << 8) | (1U << 9))
/* clock / 16 / baud, in 1/64 */
#define DIVISOR_64 ((4U * BOARD_UART_CLOCK_HZ + BOARD_UART_BAUD / 2U) / BOARD_UART_BAUD)

void uart_start(void) {
    UARTCR = 0U;
    UARTIBRD = DIVISOR_64 / 64U;
    UARTFBRD = DIVISOR_64 % 64U;
    UARTLCR_H = LCR_H_8_BITS_FIFO; /* must follow the divisor, which it puts into force */
    UARTCR = CR_UARTEN_TXE_RXE;
}

void uart_put(uint8_t byte) {
    while (!uart_ready()) {
    }
    UARTDR = byte;
}

bool uart_ready(void) {
    return (UARTFR & FR_TXFF) == 0U;
}

int32_t uart_get(void) {
    if ((UARTFR & FR_RXFE) != 0U) {
        return -1;
    }
    return (int32_t)(UARTDR & 0xFFU);
}
