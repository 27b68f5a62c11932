// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/location_json.h"

#include <cmath>

namespace pliant {
namespace {

double Hundredths(double pixels) { return std::round(pixels * 100) / 100; }

}  // namespace

Json PointJson(Vec2 point) { return Json::array({Hundredths(point.x), Hundredths(point.y)}); }

Json MeshJson(const Mesh& mesh) {
  Json points = Json::array();
  for (const Vec2 point : mesh.points) points.push_back(PointJson(point));
  return {{"columns", mesh.columns},
          {"rows", mesh.rows},
          {"reference_width", mesh.reference_width},
          {"reference_height", mesh.reference_height},
          {"points", std::move(points)},
          {"trusted", mesh.trusted}};
}

Json LocationJson(const Location& location) {
  Json json = {{"found", location.found},
               {"reason", location.found ? Json(nullptr) : Json(ToString(location.reason))},
               {"keypoints", location.keypoints},
               {"matches", location.matches},
               {"inliers", location.inliers.size()},
               {"inlier_rate", std::round(location.inlier_rate() * 1e4) / 1e4},
               {"outline", nullptr},
               {"mesh", nullptr}};
  if (location.found) {
    json["outline"] = Json::array();
    for (const Vec2 point : location.outline) json["outline"].push_back(PointJson(point));
    json["mesh"] = MeshJson(*location.mesh);
  }
  return json;
}

}  // namespace pliant
