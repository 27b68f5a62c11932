// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/result_json.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "index/verify/warp_mesh.h"

namespace pliant {
namespace {

using Json = nlohmann::ordered_json;

Json PolygonJson(const std::vector<Point>& polygon) {
  if (polygon.empty()) return nullptr;
  Json points = Json::array();
  for (const Point& p : polygon) points.push_back({p.x, p.y});
  return points;
}

double Hundredths(double pixels) { return std::round(pixels * 100) / 100; }

Json ExplanationJson(const Explanation& e) {
  Json pairs = Json::array();
  for (const PointPair& pair : e.inliers) {
    pairs.push_back({Hundredths(pair.query.x), Hundredths(pair.query.y),
                     Hundredths(pair.reference.x), Hundredths(pair.reference.y)});
  }
  Json reference;  // null
  if (e.reference_width > 0) {
    reference = {{"width", e.reference_width}, {"height", e.reference_height}};
  }
  return {{"ranking_score", e.ranking_score},
          {"verified", e.verified},
          {"failure", e.failure.empty() ? Json(nullptr) : Json(e.failure)},
          {"matches", e.matches},
          {"inlier_fraction", e.inlier_fraction},
          {"pairs", std::move(pairs)},
          {"reference", std::move(reference)},
          {"mesh", e.mesh ? Json::parse(MeshJson(*e.mesh)) : Json(nullptr)}};
}

Json InstancesJson(const std::vector<Instance>& instances) {
  Json all = Json::array();
  for (const Instance& instance : instances) {
    all.push_back({{"inliers", instance.inliers}, {"polygon", PolygonJson(instance.polygon)}});
  }
  return all;
}

Json HitJson(const Hit& hit) {
  Json json = {{"rank", hit.rank},
               {"object", hit.object.empty() ? Json(nullptr) : Json(hit.object)},
               {"score", hit.score},
               {"image_id", hit.image_id},
               {"inliers", hit.inliers},
               {"polygon", PolygonJson(hit.polygon)},
               {"instances", InstancesJson(hit.instances)},
               {"via", hit.via.empty() ? Json(nullptr) : Json(hit.via)},
               {"metadata", Json::parse(hit.metadata)}};
  if (hit.explanation) json["explain"] = ExplanationJson(*hit.explanation);
  return json;
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
                     {"query", {{"width", result.query_width}, {"height", result.query_height}}},
                     {"total", result.total},
                     {"hits", std::move(hits)},
                     {"timings",
                      {{"decode_ms", t.extraction.decode_ms},
                       {"detect_ms", t.extraction.detect_ms},
                       {"describe_ms", t.extraction.describe_ms},
                       {"quantize_ms", t.quantize_ms},
                       {"rank_ms", t.rank_ms},
                       {"verify_ms", t.verify_ms},
                       {"database_ms", t.database_ms}}}};
  return json.dump(indent);
}

}  // namespace pliant
