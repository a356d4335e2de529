#define DEFORM_LANES Avx512Lanes
#define DEFORM_LANE_BYTES 64
#include "core/weights/schemes/celestial_lanes.inc"
