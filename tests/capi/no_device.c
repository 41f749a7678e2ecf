/* SPDX-License-Identifier: Apache-2.0 */
/* Run by CTest where the loader finds no driver, or where there is no loader: both libraries say what to install, and simsense still runs
 * on the host. Prints what it saw; exits 0 when every expectation holds. C99 on purpose: the public headers link from plain C. */
#include <stdio.h>
#include <string.h>

#include "kuafu/kuafu.h"
#include "simsense/simsense.h"

static int failures = 0;

static void expect(int holds, const char* what) {
  if (!holds) {
    ++failures;
    printf("FAILED: %s\n", what);
  }
}

int main(int argc, char** argv) {
  const char* cause = argc > 1 ? argv[1] : "";
  uint32_t count = 7;
  kuafu_device device = NULL;
  simsense_device host = NULL;
  ks_device_desc desc = ks_device_desc_init();

  expect(kuafu_device_enumerate(NULL, &count) == KS_OK && count == 0, "enumerate succeeds with no device");
  printf("enumerate: %s\n", kuafu_last_error());
  expect(strstr(kuafu_last_error(), cause) != NULL, "the reason is named");
  expect(kuafu_device_create(NULL, &device) == KS_ERROR_NO_DEVICE && device == NULL, "create says KS_ERROR_NO_DEVICE");
  printf("create: %s\n", kuafu_last_error());
  expect(strstr(kuafu_last_error(), "libvulkan1") != NULL, "the text names libvulkan1");
  expect(strstr(kuafu_last_error(), "mesa-vulkan-drivers") != NULL, "the text names mesa-vulkan-drivers");
  expect(simsense_device_create(&desc, &host) == KS_ERROR_NO_DEVICE, "simsense says the same");
  desc.select = KS_SELECT_HOST;
  expect(simsense_device_create(&desc, &host) == KS_OK, "simsense runs on the host");
  simsense_device_release(host);
  return failures != 0;
}
