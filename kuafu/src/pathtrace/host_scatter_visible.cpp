#define KUAFU_CHANNELS 3
#include "pathtrace/host_scatter.inc"
