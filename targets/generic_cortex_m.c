/* generic_cortex_m.c -- the two functions that a board's UART consists of, here for one of the 16550 kind
 *
 * National Semiconductor PC16550D: RBR/THR at 0, LSR at 5, registers 4 bytes apart as most chips have them.
 */
#include "board.h"
#include "board_config.h"

#define UART_RBR_THR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define UART_LSR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x14U))

#define LSR_DATA_READY 0x01U
#define LSR_THR_EMPTY 0x20U

bool board_putc(uint8_t byte) {
    if ((UART_LSR & LSR_THR_EMPTY) == 0U) {
        return false;
    }
    UART_RBR_THR = byte;
    return true;
}

int board_getc(void) {
    return ((UART_LSR & LSR_DATA_READY) != 0U) ? (int)(UART_RBR_THR & 0xFFU) : -1;
}
