/* uart_ns16550.c -- a UART of the 16550 kind (National Semiconductor PC16550D), its registers bytes, one after the other */
#include "board.h"
#include "board_config.h"

#define UART_REGISTER(offset) (*(volatile uint8_t *)(BOARD_UART_BASE + (offset)))
#define UART_RBR_THR UART_REGISTER(0U) /* the divisor's low byte while LCR_DLAB is set */
#define UART_IER UART_REGISTER(1U)     /* its high byte */
#define UART_FCR UART_REGISTER(2U)
#define UART_LCR UART_REGISTER(3U)
#define UART_LSR UART_REGISTER(5U)

#define FCR_ENABLE_CLEAR 0x07U
#define LCR_8_BITS 0x03U
#define LCR_DLAB 0x80U
#define LSR_DATA_READY 0x01U
#define LSR_THR_EMPTY 0x20U
#define DIVISOR ((BOARD_UART_CLOCK_HZ + 8U * BOARD_UART_BAUD) / (16U * BOARD_UART_BAUD))

void uart_start(void) {
    UART_IER = 0U;
    UART_LCR = LCR_DLAB | LCR_8_BITS;
    UART_RBR_THR = (uint8_t)(DIVISOR & 0xFFU);
    UART_IER = (uint8_t)(DIVISOR >> 8);
    UART_LCR = LCR_8_BITS;
    UART_FCR = FCR_ENABLE_CLEAR;
}

void uart_put(uint8_t byte) {
    while (!uart_ready()) {
    }
    UART_RBR_THR = byte;
}

bool uart_ready(void) {
    return (UART_LSR & LSR_THR_EMPTY) != 0U;
}

int32_t uart_get(void) {
    if ((UART_LSR & LSR_DATA_READY) == 0U) {
        return -1;
    }
    return (int32_t)UART_RBR_THR;
}
