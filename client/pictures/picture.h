// Pictures of models and their rigs, for people.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/pictures/camera.h"
#include "client/pictures/color_scale.h"
#include "client/pictures/image.h"
#include "core/mesh/types.h"

namespace deform {

// One state of the model, drawn beside the others at the same scale.
struct PicturePanel {
  std::string caption;  // Lines of printable ASCII; may be empty.
  Positions positions;  // N x 3.
  Positions rig;        // V x 3 posed rig vertices; 0 x 3 draws none.
  // The rig's vertices are handles, without the picture's rig faces. Those far
  // outside the model may fall out of the picture.
  bool rig_is_handles = false;
  // N numbers that the picture's scale colours, NaN for unknown; or empty.
  std::vector<double> values = {};
};

struct Picture {
  int dimension = 3;
  // Triangles; a model without them is drawn as points.
  Faces faces;
  // F x dimension of the cage; without faces the rig's vertices are drawn as
  // handles.
  Faces rig_faces;
  std::vector<PicturePanel> panels;
  // Points drawn as dots, such as clamped ones.
  std::vector<int64_t> marked = {};
  ColorScale scale;  // Of the panels' values.
  View view;         // Of no meaning in 2D.
  // Of each panel, pixels, 64 to 4096.
  int width = 900;
  int height = 900;
};

// Draws the panels side by side on a light ground, all through one camera, so
// that they can be compared. 3D: shaded, with the cage as wires. 2D: flat, with
// a chequered pattern that was regular in the first panel, or with bands of
// colour, twenty from end to end of the scale.
//
// InvalidArgument (BAD_PICTURE) if there is nothing to draw, a size is out of
// range, panels differ in their number of points or values, a face refers to a
// vertex that is not there, or a coordinate is not finite.
absl::StatusOr<Image> DrawPicture(const Picture& picture);

}  // namespace deform
