// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/result_json.h"

#include <nlohmann/json.hpp>

namespace pliant {
namespace {

using Json = nlohmann::ordered_json;

Json PolygonJson(const std::vector<Point>& polygon) {
  if (polygon.empty()) return nullptr;
  Json points = Json::array();
  for (const Point& p : polygon) points.push_back({p.x, p.y});
  return points;
}

Json HitJson(const Hit& hit) {
  return {{"rank", hit.rank},
          {"object", hit.object.empty() ? Json(nullptr) : Json(hit.object)},
          {"score", hit.score},
          {"image_id", hit.image_id},
          {"inliers", hit.inliers},
          {"polygon", PolygonJson(hit.polygon)},
          {"metadata", Json::parse(hit.metadata)}};
}

}  // namespace

std::string SearchResultJson(const SearchResult& result, double took_ms, int indent) {
  Json hits = Json::array();
  for (const Hit& hit : result.hits) hits.push_back(HitJson(hit));
  const SearchTimings& t = result.timings;
  const Json json = {{"took_ms", took_ms},
                     {"vocabulary", result.vocabulary},
                     {"words", result.words},
                     {"keypoints", result.keypoints},
                     {"total", result.total},
                     {"hits", std::move(hits)},
                     {"timings",
                      {{"decode_ms", t.extraction.decode_ms},
                       {"detect_ms", t.extraction.detect_ms},
                       {"describe_ms", t.extraction.describe_ms},
                       {"quantize_ms", t.quantize_ms},
                       {"rank_ms", t.rank_ms},
                       {"verify_ms", t.verify_ms}}}};
  return json.dump(indent);
}

}  // namespace pliant
