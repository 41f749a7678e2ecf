#define KUAFU_CHANNELS 1
#include "pathtrace/host_scatter.inc"
