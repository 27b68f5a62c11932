// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What is known about a simulated sequence: the object in its template (view 0), and where its
// points are in the other views. Internal to this folder.
#pragma once

#include <vector>

#include "descriptor/evaluation/truth_scene.h"
#include "index/tracking/tracker.h"

namespace pliant {

// What of the template is the object.
struct TemplateTruth {
  PixelBox box;
  Image mask;                 // of view 0's size
  Image picture;              // the box of view 0
  std::vector<Vec2> samples;  // every 8 pixels of view 0, on the object
};

// Without samples where view 0 shows no object.
TemplateTruth FindTemplate(const evaluation::TruthScene& scene);

// The sampled points that a view shows.
struct ViewTruth {
  std::vector<Vec2> samples;  // pixels of the template's box
  std::vector<Vec2> seen;     // where they are in the view
  double size_px = 0;
};

ViewTruth FindSeen(evaluation::TruthScene& scene, const TemplateTruth& reference, int view);

}  // namespace pliant
