/* SPDX-License-Identifier: Apache-2.0 */
/* CUDA's driver as far as external memory goes, over files that can be mapped, as lavapipe's opaque fds are: a program that imports such
 * memory gets the very same bytes. Where in the file they begin is the driver's secret, which a test finds out and tells. For tests on
 * machines without CUDA. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

static uint8_t uuid[16];
static uint64_t data_begin;
static int mappings, contexts, pushed;

struct external_memory {
  char* mapped;
  uint64_t data_bytes;
};
struct handle_desc {
  int type;
  union {
    int fd;
    void* pair[2];
  } handle;
  unsigned long long size;
  unsigned int flags;
  unsigned int reserved[16];
};
struct buffer_desc {
  unsigned long long offset, size;
  unsigned int flags;
  unsigned int reserved[16];
};

void stub_be(const uint8_t* of, uint64_t begin) { memcpy(uuid, of, 16), data_begin = begin; }
int stub_held(void) { return mappings + contexts + pushed; }

int cuInit(unsigned flags) { return flags == 0 ? 0 : 1; }
int cuGetErrorString(int status, const char** text) { return *text = status == 1 ? "invalid argument" : "other", 0; }
int cuDeviceGetCount(int* count) { return *count = 2, 0; }
int cuDeviceGet(int* device, int ordinal) { return *device = ordinal + 7, 0; }
int cuDeviceGetUuid(uint8_t* out, int device) {
  memcpy(out, uuid, 16);
  if (device == 7) out[0] ^= 1; /* another GPU of the machine */
  return 0;
}
int cuDevicePrimaryCtxRetain(void** context, int device) { return *context = &uuid, ++contexts, device == 8 ? 0 : 1; }
int cuDevicePrimaryCtxRelease_v2(int device) { return --contexts, device == 8 ? 0 : 1; }
int cuCtxPushCurrent_v2(void* context) { return ++pushed, context == &uuid ? 0 : 1; }
int cuCtxPopCurrent_v2(void** context) { return *context = &uuid, --pushed, 0; }

int cuImportExternalMemory(struct external_memory** memory, const struct handle_desc* desc) {
  if (desc->type != 1 || desc->flags != 1 || pushed != 1) return 1;
  void* mapped = mmap(NULL, data_begin + desc->size, PROT_READ | PROT_WRITE, MAP_SHARED, desc->handle.fd, 0);
  if (mapped == MAP_FAILED) return 1;
  close(desc->handle.fd);
  ++mappings;
  *memory = malloc(sizeof(**memory));
  **memory = (struct external_memory){mapped, desc->size};
  return 0;
}
int cuExternalMemoryGetMappedBuffer(uint64_t* address, const struct external_memory* memory, const struct buffer_desc* desc) {
  if (desc->flags != 0 || desc->offset + desc->size > memory->data_bytes) return 1;
  return *address = (uint64_t)(uintptr_t)memory->mapped + data_begin + desc->offset, 0;
}
int cuMemFree_v2(uint64_t address) { return address == 0; }
int cuDestroyExternalMemory(struct external_memory* memory) {
  int failed = munmap(memory->mapped, data_begin + memory->data_bytes) != 0;
  free(memory);
  return --mappings, failed;
}
