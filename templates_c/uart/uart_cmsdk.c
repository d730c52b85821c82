/* uart_cmsdk.c -- the UART of the Arm Cortex-M System Design Kit (DDI 0479, "APB UART") */
#include "board.h"
#include "board_config.h"

#define UART_DATA (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define UART_STATE (*(volatile uint32_t *)(BOARD_UART_BASE + 0x04U))
#define UART_CTRL (*(volatile uint32_t *)(BOARD_UART_BASE + 0x08U))
#define UART_BAUDDIV (*(volatile uint32_t *)(BOARD_UART_BASE + 0x10U))

#define STATE_TX_FULL 1U
#define STATE_RX_FULL 2U
#define CTRL_TX_RX 3U

void uart_start(void) {
    UART_BAUDDIV = BOARD_UART_CLOCK_HZ / BOARD_UART_BAUD;
    UART_CTRL = CTRL_TX_RX;
    (void)UART_DATA; /* empties the receiver; QEMU also takes it as the sign to deliver what came before */
}

void uart_put(uint8_t byte) {
    while (!uart_ready()) {
    }
    UART_DATA = byte;
}

bool uart_ready(void) {
    return (UART_STATE & STATE_TX_FULL) == 0U;
}

int32_t uart_get(void) {
    if ((UART_STATE & STATE_RX_FULL) == 0U) {
        return -1;
    }
    return (int32_t)(UART_DATA & 0xFFU);
}
