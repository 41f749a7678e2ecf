/* SPDX-License-Identifier: Apache-2.0 */
/* Prints the version of the library that the host project built. */
#include <stdio.h>

#include "simsense/simsense.h"

int main(void) {
  printf("simsense %u\n", simsense_version());
  return 0;
}
