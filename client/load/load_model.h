// Models to put load on a server with, when there are none at hand.
#pragma once

#include <cstdint>
#include <string>

#include "client/cpp/arrays.h"

namespace deform {

struct LoadModel {
  ModelArrays model;
  BindingSpec spec;  // Without the model's id.
};

// A bumpy ball of about `points` points: in a spherical cage of about
// `cage_faces` triangles, or, if `handles` > 0, among so many handles, with
// those of its box fixed. Models of different `number` differ in size, so that
// a server keeps them apart. Counts: of points 12 or more, of faces 20 or more.
LoadModel MakeLoadModel(int64_t points, int64_t cage_faces, int64_t handles,
                        int64_t number);

}  // namespace deform
