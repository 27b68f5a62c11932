// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/suppression.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <unordered_map>

#include "index/verify/outline.h"
#include "index/verify/verification.h"

namespace pliant {
namespace {

// Images that are less probable beat nobody, and have nothing to lose.
constexpr double kLeastProbability = 0.05;
// The odds of objects at one place differ by more than their evidence says: what they have in
// common agrees with both. Fitted to real packages and banknotes.
constexpr double kSharpness = 3;

struct Box {
  Vec2 low, high;

  bool Meets(const Box& other) const {
    return low.x <= other.high.x && other.low.x <= high.x && low.y <= other.high.y &&
           other.low.y <= high.y;
  }
};

// An instance of a named object in the query.
struct Place {
  std::size_t image = 0;     // of the list
  std::size_t instance = 0;  // of the image
  std::vector<Vec2> outline;
  std::vector<Vec2> points;  // of the query that it matches
  Box box;                   // of the outline
  double independent = 0;    // points, each divided by how many lie in its place
  std::size_t kept = 0;      // matches that the object keeps
  double odds = 0;           // of what is seen here alone
};

Box BoxOf(std::span<const Vec2> outline) {
  Box box{outline.front(), outline.front()};
  for (const Vec2 p : outline) {
    box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y)};
    box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y)};
  }
  return box;
}

double Odds(double probability) { return probability / std::max(1e-12, 1 - probability); }

double OddsAt(const VerifiedImage& image, const Place& place) {
  const auto points = static_cast<double>(place.points.size());
  const double share = static_cast<double>(place.kept) / points;
  const double evidence = Evidence(place.independent, image.by_chance) * std::sqrt(share);
  return Odds(Probability(LiftScore(image.ranking_score, evidence)));
}

// The matches of an image stand in the order of its instances.
std::vector<Place> PlacesOf(const Features& query, const std::vector<VerifiedImage>& images) {
  const NearestMatches nearest(images);
  std::vector<Place> places;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const VerifiedImage& image = images[i];
    if (image.image.object == 0 || image.probability < kLeastProbability) continue;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < image.instances.size(); ++k) {
      const Instance& instance = image.instances[k];
      Place place;
      place.image = i;
      place.instance = k;
      place.independent = instance.independent;
      for (const Point p : instance.polygon) place.outline.push_back({p.x, p.y});
      const std::size_t end =
          std::min(image.matches.size(), begin + static_cast<std::size_t>(instance.inliers));
      for (; begin < end; ++begin) {
        const QueryMatch& match = image.matches[begin];
        const Keypoint& point = query.keypoints[match.keypoint];
        place.points.push_back({point.x, point.y});
        place.kept += nearest.Keeps(image.image.object, match) ? 1 : 0;
      }
      if (place.outline.empty() || place.points.empty()) continue;
      place.box = BoxOf(place.outline);
      place.odds = OddsAt(image, place);
      places.push_back(std::move(place));
    }
  }
  return places;
}

bool HalfInside(std::span<const Vec2> points, std::span<const Vec2> outline) {
  const auto inside =
      std::count_if(points.begin(), points.end(), [&](Vec2 p) { return IsInside(p, outline); });
  return 2 * static_cast<std::size_t>(inside) >= points.size();
}

bool AreSame(const Place& a, const Place& b) {
  return a.box.Meets(b.box) && HalfInside(a.points, b.outline) && HalfInside(b.points, a.outline);
}

// How many times more probable it is that something else is there.
double Doubt(double rivals_odds, double odds) {
  return std::pow(rivals_odds / std::max(1e-12, odds), kSharpness);
}

// What the other objects at the same place say of it.
struct Rivals {
  double doubt = 0;     // all of them
  bool beaten = false;  // one keeps more
};

Rivals RivalsOf(const Place& place, const std::vector<Place>& places,
                const std::vector<VerifiedImage>& images) {
  const auto object_of = [&](const Place& p) { return images[p.image].image.object; };
  Rivals rivals;
  std::map<std::int64_t, double> doubts;  // the most of each object
  for (const Place& other : places) {
    if (object_of(other) == object_of(place) || other.kept == place.kept ||
        !AreSame(place, other)) {
      continue;
    }
    double& doubt = doubts[object_of(other)];
    doubt = std::max(doubt, Doubt(other.odds, place.odds));
    if (other.kept > place.kept) rivals.beaten = true;
  }
  for (const auto& [object, doubt] : doubts) rivals.doubt += doubt;
  return rivals;
}

// What agrees with the query through another image is no more probable than that one is, and less
// where the two have different names.
void FollowTheirSources(std::vector<VerifiedImage>* images) {
  std::unordered_map<std::string, const VerifiedImage*> by_id;
  std::vector<VerifiedImage*> supported;
  for (VerifiedImage& image : *images) {
    by_id.emplace(image.image.ref.id, &image);
    if (!image.via.empty()) supported.push_back(&image);
  }
  // A source has more evidence than what it supports.
  std::stable_sort(supported.begin(), supported.end(),
                   [](const auto* a, const auto* b) { return a->evidence > b->evidence; });
  for (VerifiedImage* image : supported) {
    const auto at = by_id.find(image->via);
    if (at == by_id.end()) continue;
    const VerifiedImage& source = *at->second;
    const double alone = Probability(image->image.score);
    const double sources = Probability(source.image.score);
    const std::int64_t object = image->image.object;
    const bool is_rival = object != 0 && source.image.object != 0 && object != source.image.object;
    image->probability = alone * source.probability / std::max(1e-12, sources) /
                         (1 + (is_rival ? Doubt(Odds(sources), Odds(alone)) : 0));
  }
}

// Takes these instances, in ascending order, from the image; the first one where all would go.
void Drop(std::vector<std::size_t> instances, VerifiedImage* image) {
  if (instances.size() == image->instances.size() && !instances.empty()) {
    instances.erase(instances.begin());
  }
  for (auto instance = instances.rbegin(); instance != instances.rend(); ++instance) {
    const auto at = static_cast<std::ptrdiff_t>(*instance);
    image->instances.erase(image->instances.begin() + at);
    if (!image->explanations.empty()) {
      image->explanations.erase(image->explanations.begin() + at);
    }
  }
}

}  // namespace

void SuppressNonMaxima(const Features& query, std::vector<VerifiedImage>* images) {
  for (VerifiedImage& image : *images) {
    image.probability = Probability(image.image.score);
  }
  const std::vector<Place> places = PlacesOf(query, *images);
  std::vector<double> doubts(images->size(), std::numeric_limits<double>::infinity());
  std::vector<std::vector<std::size_t>> lost(images->size());  // instances
  for (const Place& place : places) {
    const Rivals rivals = RivalsOf(place, places, *images);
    double& doubt = doubts[place.image];
    doubt = std::min(doubt, rivals.doubt);
    if (rivals.beaten) lost[place.image].push_back(place.instance);
  }
  for (std::size_t i = 0; i < images->size(); ++i) {
    if (std::isfinite(doubts[i])) (*images)[i].probability /= 1 + doubts[i];
  }
  FollowTheirSources(images);
  for (std::size_t i = 0; i < images->size(); ++i) Drop(lost[i], &(*images)[i]);
}

}  // namespace pliant
