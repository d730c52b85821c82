/* boot_rp2040.c -- the second stage that an RP2040 loads from the first 256 bytes of its flash
 *
 * RP2040 datasheet, section 2.8.1. It sets the SSI to plain 03h reads, which every serial flash knows (section 4.10),
 * and starts the image whose vector table follows. The boot ROM runs it only if the last word is the CRC-32 (polynomial
 * 0x04C11DB7, not reflected, no final complement) of the 252 bytes before it.
 */
__asm__(".section .boot, \"ax\", %progbits\n"
        ".syntax unified\n"
        ".thumb\n"
        "boot_start:\n"
        "ldr r3, =0x18000000\n" /* XIP_SSI */
        "movs r1, #0\n"
        "str r1, [r3, #0x08]\n" /* SSIENR: off while it is changed */
        "movs r1, #4\n"
        "str r1, [r3, #0x14]\n" /* BAUDR: a quarter of the system clock */
        "ldr r1, =0x001F0300\n" /* CTRLR0: 32-bit frames, EEPROM read */
        "str r1, [r3, #0x00]\n"
        "movs r1, #0\n"
        "str r1, [r3, #0x04]\n" /* CTRLR1: one frame a read */
        "ldr r1, =0x03000218\n" /* SPI_CTRLR0: command 03h, 8-bit instruction, 24-bit address, all on one line */
        "movs r2, #0xF4\n"
        "str r1, [r3, r2]\n"
        "movs r1, #1\n"
        "str r1, [r3, #0x08]\n" /* SSIENR: on */
        "ldr r0, =0x10000100\n" /* the vector table */
        "ldr r1, =0xE000ED08\n" /* VTOR */
        "str r0, [r1]\n"
        "ldr r1, [r0, #0]\n"
        "msr msp, r1\n"
        "ldr r0, [r0, #4]\n"
        "bx r0\n"
        ".ltorg\n"
        ".space 252 - (. - boot_start)\n"
        ".word 0x1808D90B\n"
        ".text\n");
