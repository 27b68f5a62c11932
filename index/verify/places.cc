// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/places.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <span>

#include "index/verify/outline.h"

namespace pliant {
namespace {

// Pictures that are less probable beat nobody, and have nothing to lose.
constexpr double kLeastProbability = 0.05;

struct Box {
  Vec2 low, high;

  bool Meets(const Box& other) const {
    return low.x <= other.high.x && other.low.x <= high.x && low.y <= other.high.y &&
           other.low.y <= high.y;
  }
};

// An instance of a named object in the query.
struct Place {
  std::size_t picture = 0;   // of the list
  std::size_t instance = 0;  // of the picture
  std::vector<Vec2> outline;
  std::vector<Vec2> points;  // of the query that it claims
  Box box;                   // of the outline
  std::size_t kept = 0;      // claims that the object keeps
  bool beaten = false;
};

Box BoxOf(std::span<const Vec2> outline) {
  Box box{outline.front(), outline.front()};
  for (const Vec2 p : outline) {
    box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y)};
    box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y)};
  }
  return box;
}

// The claims of a picture stand in the order of its instances.
std::vector<Place> PlacesOf(const Features& query, const std::vector<VerifiedPicture>& pictures) {
  const NearestClaims nearest(pictures);
  std::vector<Place> places;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const VerifiedPicture& picture = pictures[i];
    if (picture.picture.object == 0 || picture.probability < kLeastProbability) continue;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < picture.instances.size(); ++k) {
      const Instance& instance = picture.instances[k];
      Place place;
      place.picture = i;
      place.instance = k;
      for (const Point p : instance.polygon) place.outline.push_back({p.x, p.y});
      const std::size_t end =
          std::min(picture.claims.size(), begin + static_cast<std::size_t>(instance.inliers));
      for (; begin < end; ++begin) {
        const Claim& claim = picture.claims[begin];
        const Keypoint& point = query.keypoints[claim.keypoint];
        place.points.push_back({point.x, point.y});
        place.kept += nearest.Keeps(picture.picture.object, claim) ? 1 : 0;
      }
      if (place.outline.empty() || place.points.empty()) continue;
      place.box = BoxOf(place.outline);
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

double Odds(double probability) { return probability / std::max(1e-12, 1 - probability); }

}  // namespace

void SettlePlaces(const Features& query, std::vector<VerifiedPicture>* pictures) {
  for (VerifiedPicture& picture : *pictures) {
    picture.probability = Probability(picture.picture.score);
  }
  std::vector<Place> places = PlacesOf(query, *pictures);
  std::vector<std::vector<std::size_t>> beaten_by(pictures->size());
  for (Place& place : places) {
    for (const Place& other : places) {
      const bool is_rival =
          (*pictures)[place.picture].picture.object != (*pictures)[other.picture].picture.object;
      if (!is_rival || other.kept <= place.kept || !AreSame(place, other)) continue;
      place.beaten = true;
      beaten_by[place.picture].push_back(other.picture);
    }
  }
  std::vector<bool> stands(pictures->size(), false);
  for (const Place& place : places) {
    if (!place.beaten) stands[place.picture] = true;
  }
  std::vector<double> alone;
  for (const VerifiedPicture& picture : *pictures) alone.push_back(picture.probability);
  for (std::size_t i = 0; i < pictures->size(); ++i) {
    std::vector<std::size_t>& rivals = beaten_by[i];
    if (stands[i] || rivals.empty()) continue;
    std::sort(rivals.begin(), rivals.end());
    rivals.erase(std::unique(rivals.begin(), rivals.end()), rivals.end());
    double sum = 1 + Odds(alone[i]);
    for (const std::size_t rival : rivals) sum += Odds(alone[rival]);
    (*pictures)[i].probability = Odds(alone[i]) / sum;
  }
  for (auto place = places.rbegin(); place != places.rend(); ++place) {  // the last ones first
    if (!place->beaten || place->instance == 0) continue;
    auto& instances = (*pictures)[place->picture].instances;
    instances.erase(instances.begin() + static_cast<std::ptrdiff_t>(place->instance));
  }
}

}  // namespace pliant
