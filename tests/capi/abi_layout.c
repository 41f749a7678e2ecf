/* SPDX-License-Identifier: Apache-2.0 */
/* The structs that have no table (abi_layout_tables.c has the others). The ABI that callers were compiled against, for 64-bit targets:
 * sizes and offsets never change, new fields are appended, and no struct ends in padding (a field appended into padding would leave the
 * size, and with it the version check, as it was). A failure is a negative array size. */
#include <stddef.h>

#include "ks/header.h"
#include "ks/status.h"

#define JOIN_EXPANDED(a, b) a##b
#define JOIN(a, b) JOIN_EXPANDED(a, b)
#define HOLDS(condition) typedef char JOIN(layout_line_, __LINE__)[(condition) ? 1 : -1] __attribute__((unused))
#define SIZE(type, bytes) HOLDS(sizeof(type) == (bytes))
#define AT(type, field, bytes) HOLDS(offsetof(type, field) == (bytes))

SIZE(ks_status, 4);

SIZE(ks_header, 8);
AT(ks_header, size_bytes, 0);
AT(ks_header, type, 4);
