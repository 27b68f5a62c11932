// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/selftest/self_test_json.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "descriptor/base/base64.h"

namespace pliant {
namespace {

constexpr std::size_t kMostListed = 50;
constexpr std::size_t kMostExamples = 4;              // of each verdict
constexpr std::array kSizes = {0.0, 0.25, 0.5, 1.0};  // borders of the classes

// With its interval of 95 % (Wilson 1927), which holds for few photos and for shares near 0 and 1.
Json ShareJson(std::size_t count, std::size_t of) {
  if (of == 0) return nullptr;
  constexpr double kZ = 1.96;
  const auto n = static_cast<double>(of);
  const double share = static_cast<double>(count) / n;
  const double scale = 1 + kZ * kZ / n;
  const double middle = (share + kZ * kZ / (2 * n)) / scale;
  const double half = kZ * std::sqrt(share * (1 - share) / n + kZ * kZ / (4 * n * n)) / scale;
  return {{"count", count},
          {"share", share},
          {"low", std::max(0.0, middle - half)},
          {"high", std::min(1.0, middle + half)}};
}

const char* NameOf(SelfTestVerdict verdict) {
  switch (verdict) {
    case SelfTestVerdict::kFound:
      return "found";
    case SelfTestVerdict::kPerhaps:
      return "perhaps";
    case SelfTestVerdict::kMissed:
      return "missed";
    case SelfTestVerdict::kWrong:
      return "wrong";
  }
  return "";
}

double SizeOf(const SelfTestPhoto& photo) { return std::sqrt(photo.share); }

Json ShareOf(const std::vector<SelfTestPhoto>& photos, auto is_in, auto is_counted) {
  std::size_t count = 0;
  std::size_t of = 0;
  for (const SelfTestPhoto& photo : photos) {
    if (!is_in(photo)) continue;
    ++of;
    if (is_counted(photo)) ++count;
  }
  return ShareJson(count, of);
}

bool IsFound(const SelfTestPhoto& photo) { return photo.verdict == SelfTestVerdict::kFound; }

Json OutcomesJson(const std::vector<SelfTestPhoto>& photos) {
  const auto all = [](const SelfTestPhoto&) { return true; };
  Json outcomes;
  for (const auto verdict : {SelfTestVerdict::kFound, SelfTestVerdict::kPerhaps,
                             SelfTestVerdict::kMissed, SelfTestVerdict::kWrong}) {
    outcomes[NameOf(verdict)] =
        ShareOf(photos, all, [&](const SelfTestPhoto& photo) { return photo.verdict == verdict; });
  }
  outcomes["false_alarms"] =
      ShareOf(photos, all, [](const SelfTestPhoto& photo) { return photo.false_alarm; });
  return outcomes;
}

Json ByStrength(const std::vector<SelfTestPhoto>& photos) {
  std::map<double, Json> rows;
  for (const SelfTestPhoto& photo : photos) rows[photo.strength];
  Json list = Json::array();
  for (auto& [strength, row] : rows) {
    const auto is_in = [&, at = strength](const SelfTestPhoto& p) { return p.strength == at; };
    list.push_back({{"strength", strength},
                    {"photos", std::ranges::count_if(photos, is_in)},
                    {"found", ShareOf(photos, is_in, IsFound)}});
  }
  return list;
}

Json BySize(const std::vector<SelfTestPhoto>& photos) {
  Json list = Json::array();
  for (std::size_t i = 0; i + 1 < kSizes.size(); ++i) {
    const auto is_in = [&](const SelfTestPhoto& photo) {
      const bool last = i + 2 == kSizes.size();
      return SizeOf(photo) >= kSizes[i] && (last || SizeOf(photo) < kSizes[i + 1]);
    };
    list.push_back({{"from", kSizes[i]},
                    {"to", kSizes[i + 1]},
                    {"photos", std::ranges::count_if(photos, is_in)},
                    {"found", ShareOf(photos, is_in, IsFound)}});
  }
  return list;
}

Json MissedJson(const std::vector<SelfTestPhoto>& photos) {
  struct Row {
    const SelfTestPhoto* photo = nullptr;
    int photos = 0;
    int missed = 0;
  };
  std::map<std::string, Row> rows;
  for (const SelfTestPhoto& photo : photos) {
    Row& row = rows[photo.image_id];
    row.photo = &photo;
    ++row.photos;
    if (photo.verdict == SelfTestVerdict::kMissed) ++row.missed;
  }
  std::vector<Row> missed;
  for (const auto& [id, row] : rows) {
    if (row.missed > 0) missed.push_back(row);
  }
  std::ranges::stable_sort(missed, std::greater(), &Row::missed);
  Json list = Json::array();
  for (const Row& row : missed) {
    if (list.size() == kMostListed) break;
    list.push_back({{"object", TextOrNull(row.photo->object)},
                    {"image_id", row.photo->image_id},
                    {"photos", row.photos},
                    {"missed", row.missed}});
  }
  return list;
}

Json ExamplesJson(const std::vector<SelfTestPhoto>& photos) {
  std::map<SelfTestVerdict, std::size_t> shown;
  Json list = Json::array();
  for (const SelfTestPhoto& photo : photos) {
    if (++shown[photo.verdict] > kMostExamples) continue;
    list.push_back({{"object", TextOrNull(photo.object)},
                    {"image_id", photo.image_id},
                    {"verdict", NameOf(photo.verdict)},
                    {"probability", photo.probability},
                    {"strength", photo.strength},
                    {"size", SizeOf(photo)},
                    {"photo", Base64(photo.thumbnail.data(), photo.thumbnail.size())}});
  }
  return list;
}

}  // namespace

Json SelfTestJson(const SelfTestReport& report, const SelfTestOptions& options, bool examples) {
  const std::vector<SelfTestPhoto>& photos = report.photos;
  Json similar = Json::array();
  for (const SimilarObjects& pair : report.similar) {
    if (similar.size() == kMostListed) break;
    similar.push_back({{"object", TextOrNull(pair.object)},
                       {"image_id", pair.image_id},
                       {"other", TextOrNull(pair.other)},
                       {"other_image", pair.other_image},
                       {"confused", pair.confused}});
  }
  Json plain = Json::array();
  for (const PlainImage& image : report.plain) {
    if (plain.size() == kMostListed) break;
    plain.push_back({{"object", TextOrNull(image.object)},
                     {"image_id", image.image_id},
                     {"keypoints", image.keypoints}});
  }
  Json json = {{"images", report.images},          {"photos", photos.size()},
               {"outcomes", OutcomesJson(photos)}, {"by_strength", ByStrength(photos)},
               {"by_size", BySize(photos)},        {"false_alarm_rate", options.false_alarms},
               {"found_from", report.found_from},  {"reaches_rate", report.reaches_rate},
               {"similar", std::move(similar)},    {"plain", std::move(plain)},
               {"missed", MissedJson(photos)}};
  if (examples) json["examples"] = ExamplesJson(photos);
  json["seconds"] = report.seconds;
  return json;
}

}  // namespace pliant
