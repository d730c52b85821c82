/* uart_stm32_v2.c -- the USART of STM32 G4 and H7, also of F0, F3, F7, L4 (RM0440 chapter 37; RM0433 chapter 48)
 *
 * Clock gates and pins are the target's setup.
 */
#include "board.h"
#include "board_config.h"

#define USART_CR1 (*(volatile uint32_t *)(BOARD_UART_BASE + 0x00U))
#define USART_CR3 (*(volatile uint32_t *)(BOARD_UART_BASE + 0x08U))
#define USART_BRR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x0CU))
#define USART_ISR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x1CU))
#define USART_RDR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x24U))
#define USART_TDR (*(volatile uint32_t *)(BOARD_UART_BASE + 0x28U))

#define CR1_UE_RE_TE ((1U << 0) | (1U << 2) | (1U << 3))
#define CR3_OVRDIS (1U << 12)
#define ISR_RXNE (1U << 5)
#define ISR_TXE (1U << 7)

void uart_start(void) {
    USART_CR1 = 0U;
    USART_CR3 = CR3_OVRDIS; /* a lost byte damages one frame, which the line repairs; an overrun would stop reception */
    USART_BRR = (BOARD_UART_CLOCK_HZ + BOARD_UART_BAUD / 2U) / BOARD_UART_BAUD; /* oversampling by 16 */
    USART_CR1 = CR1_UE_RE_TE;
}

void uart_put(uint8_t byte) {
    while (!uart_ready()) {
    }
    USART_TDR = byte;
}

bool uart_ready(void) {
    return (USART_ISR & ISR_TXE) != 0U;
}

int32_t uart_get(void) {
    if ((USART_ISR & ISR_RXNE) == 0U) {
        return -1;
    }
    return (int32_t)(USART_RDR & 0xFFU);
}
