// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/result_json.h"

#include <cmath>
#include <optional>
#include <utility>

#include "index/json/record_json.h"

namespace pliant {
namespace {

double Hundredths(double pixels) { return std::round(pixels * 100) / 100; }

// [x, y].
Json PointJson(Vec2 point) { return Json::array({Hundredths(point.x), Hundredths(point.y)}); }

Json PolygonJson(const std::vector<Point>& polygon) {
  if (polygon.empty()) return nullptr;
  Json points = Json::array();
  for (const Point& p : polygon) points.push_back({p.x, p.y});
  return points;
}

Json AppearanceJson(const std::optional<Appearance>& appearance) {
  if (!appearance) return nullptr;
  return {{"seen_again", appearance->seen_again},
          {"colour_difference", OrNull(appearance->colour_difference)}};
}

Json ExplanationJson(const Explanation& e) {
  Json pairs = Json::array();
  for (const PointPair& pair : e.inliers) {
    Json ends = PointJson(pair.query);
    for (const Json& coordinate : PointJson(pair.reference)) ends.push_back(coordinate);
    pairs.push_back(std::move(ends));
  }
  Json reference;  // null
  if (e.reference_width > 0) {
    reference = {{"width", e.reference_width}, {"height", e.reference_height}};
  }
  return {{"ranking_score", e.ranking_score},
          {"verified", e.verified},
          {"failure", TextOrNull(e.failure)},
          {"matches", e.matches},
          {"inlier_fraction", e.inlier_fraction},
          {"independent_inliers", e.independent_inliers},
          {"colour_difference", OrNull(e.colour_difference)},
          {"appearance", AppearanceJson(e.appearance)},
          {"pairs", std::move(pairs)},
          {"reference", std::move(reference)},
          {"mesh", e.mesh ? MeshJson(*e.mesh) : Json(nullptr)}};
}

Json InstancesJson(const std::vector<Instance>& instances) {
  Json all = Json::array();
  for (const Instance& instance : instances) {
    all.push_back({{"inliers", instance.inliers}, {"polygon", PolygonJson(instance.polygon)}});
  }
  return all;
}

const char* RankName(RankMethod method) {
  return method == RankMethod::kNeighbours ? "neighbours" : "histogram";
}

const char* VerdictText(bool found, bool perhaps) {
  if (found) return "found";
  return perhaps ? "perhaps" : "not_found";
}

// Of a search; null where hits have no probability.
Json VerdictJson(const SearchResult& result) {
  if (!result.found) return nullptr;
  return VerdictText(*result.found > 0, result.perhaps);
}

Json HitVerdict(const Hit& hit, double found_from) {
  if (!hit.probability) return nullptr;
  if (*hit.probability >= found_from) return "found";
  return *hit.probability >= kPerhapsProbability ? "perhaps" : "unlikely";
}

Json HitJson(const Hit& hit, double found_from) {
  Json json = {{"rank", hit.rank},
               {"object", TextOrNull(hit.object)},
               {"score", hit.score},
               {"probability", OrNull(hit.probability)},
               {"verdict", HitVerdict(hit, found_from)},
               {"image_id", hit.image_id},
               {"source", hit.source},
               {"inliers", hit.inliers},
               {"polygon", PolygonJson(hit.polygon)},
               {"instances", InstancesJson(hit.instances)},
               {"metadata", MetadataJson(hit.metadata)}};
  if (!hit.example.empty()) json["example"] = hit.example;
  if (hit.explanation) json["explain"] = ExplanationJson(*hit.explanation);
  return json;
}

}  // namespace

Json SearchResultJson(const SearchResult& result, double took_ms) {
  Json hits = Json::array();
  for (const Hit& hit : result.hits) hits.push_back(HitJson(hit, result.found_from));
  const SearchTimings& t = result.timings;
  Json query = {{"width", result.query_width}, {"height", result.query_height}};
  Json examples = Json::array();
  for (const SearchExample& example : result.examples) {
    examples.push_back({{"image_id", example.image_id},
                        {"keypoints", example.keypoints},
                        {"width", example.width},
                        {"height", example.height}});
  }
  Json json = {{"took_ms", took_ms},
               {"rank", RankName(result.rank)},
               {"vocabulary", result.vocabulary},
               {"words", result.words},
               {"keypoints", result.keypoints},
               {"looked_closer", result.second_pass},
               {"mirrored", result.mirrored},
               {"query", examples.empty() ? std::move(query) : Json(nullptr)},
               {"total", result.total},
               {"searched", result.searched},
               {"verdict", VerdictJson(result)},
               {"found", OrNull(result.found)},
               {"hits", std::move(hits)},
               {"timings",
                {{"decode_ms", t.extraction.decode_ms},
                 {"detect_ms", t.extraction.detect_ms},
                 {"describe_ms", t.extraction.describe_ms},
                 {"quantize_ms", t.quantize_ms},
                 {"rank_ms", t.rank_ms},
                 {"verify_ms", t.verify_ms},
                 {"database_ms", t.database_ms}}}};
  if (!examples.empty()) json["examples"] = std::move(examples);
  return json;
}

Json ComparisonJson(const Comparison& comparison, double took_ms, bool explain) {
  const auto image = [](const ComparedImage& one) {
    return Json{{"width", one.width}, {"height", one.height}, {"keypoints", one.keypoints}};
  };
  const Explanation& e = comparison.explanation;
  const ExtractionTimings& t = comparison.timings;
  Json json = {{"took_ms", took_ms},
               {"verdict", VerdictText(comparison.found(), comparison.perhaps())},
               {"probability", comparison.probability},
               {"first", image(comparison.first)},
               {"second", image(comparison.second)},
               {"matches", e.matches},
               {"inliers", e.inliers.size()},
               {"inlier_fraction", e.inlier_fraction},
               {"polygon", PolygonJson(comparison.outline)},
               {"failure", TextOrNull(e.failure)},
               {"timings",
                {{"decode_ms", t.decode_ms},
                 {"detect_ms", t.detect_ms},
                 {"describe_ms", t.describe_ms},
                 {"verify_ms", comparison.verify_ms}}}};
  if (explain) json["explain"] = ExplanationJson(e);
  return json;
}

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
