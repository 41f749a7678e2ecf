#define KUAFU_CHANNELS 3
#define KUAFU_HOST_AOV aov_visible
#include "pathtrace/host_aov.inc"
