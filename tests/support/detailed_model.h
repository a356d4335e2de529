// A generated model like those that are deformed for real: limbs, fine detail,
// and many points in a coarse cage.
#pragma once

#include "tests/support/shapes.h"

namespace deform {

struct DetailedModel {
  Shape model;
  Shape cage;
};

// A cage of rings * segments + 2 vertices and 2 * rings * segments triangles,
// and in it a surface of rings * segments * detail^2 + 2 points, of which the
// nearest reach to a few hundredths of the diagonal below the cage. Star-shaped
// around the origin, about 4 long. Rows come in the order of the cage's faces.
//
//   (9, 12, 40)   172,802 points x 326 columns of Green coordinates
//   (2,  7, 197)  543,328 x 44
//   (2,  7, 267)  998,048 x 44
DetailedModel MakeDetailedModel(int rings, int segments, int detail);

}  // namespace deform
