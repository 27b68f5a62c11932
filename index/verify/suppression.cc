// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/verify/suppression.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <span>

#include "index/verify/judgement.h"
#include "index/verify/warp_geometry.h"

namespace pliant {
namespace {

struct Box {
  Vec2 low, high;

  explicit Box(std::span<const Vec2> outline) : low(outline.front()), high(outline.front()) {
    for (const Vec2 p : outline) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
  }
  bool Meets(const Box& other) const {
    return low.x <= other.high.x && other.low.x <= high.x && low.y <= other.high.y &&
           other.low.y <= high.y;
  }
};

// An instance of a named object in the query.
struct Detection {
  std::size_t image = 0;     // of the list
  std::size_t instance = 0;  // of the image
  std::int64_t object = 0;
  std::vector<Vec2> outline;
  std::vector<Vec2> points;  // of the query that it matches
  Box box;                   // of the outline
  std::size_t kept = 0;      // matches that the object keeps
  double odds = 0;           // of what is seen here alone
  double likeness = 0;       // as VerifiedImage::likeness
};

double Odds(double probability) { return probability / std::max(1e-12, 1 - probability); }

// The matches of an image are in the order of its instances.
std::vector<Detection> DetectionsIn(const Features& query,
                                    const std::vector<VerifiedImage>& images) {
  const NearestMatches nearest(images);
  const double by_chance = InliersByChance(query.keypoints.size());
  std::vector<Detection> detections;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const VerifiedImage& image = images[i];
    const std::int64_t object = image.image.object;
    if (object == 0 || image.likeness.empty()) continue;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < image.instances.size(); ++k) {
      const Instance& instance = image.instances[k];
      std::vector<Vec2> outline, points;
      for (const Point p : instance.polygon) outline.push_back({p.x, p.y});
      const std::size_t end =
          std::min(image.matches.size(), begin + static_cast<std::size_t>(instance.inliers));
      std::size_t kept = 0;
      for (; begin < end; ++begin) {
        const QueryMatch& match = image.matches[begin];
        const Keypoint& point = query.keypoints[match.keypoint];
        points.push_back({point.x, point.y});
        kept += nearest.Keeps(object, match) ? 1 : 0;
      }
      if (outline.empty() || points.empty()) continue;
      const double share = static_cast<double>(kept) / static_cast<double>(points.size());
      // Of rivals, not against chance: so both have the same inliers by chance.
      const double evidence = Evidence(instance.independent, by_chance, share);
      const double likeness = image.likeness[k];
      const double same = std::min(SameObject(likeness, true), kVerify.usually_same);
      // Sharpened later (Doubt), which the odds of siblings are not.
      const double odds = Odds(LiftScore(image.ranking_score, evidence)) *
                          std::pow(Odds(same), 1 / kVerify.sharpness);
      const Box box(outline);
      detections.push_back(
          {i, k, object, std::move(outline), std::move(points), box, kept, odds, likeness});
    }
  }
  return detections;
}

bool Overlap(const Detection& a, const Detection& b) {
  return a.box.Meets(b.box) && HalfInside(a.points, b.outline) && HalfInside(b.points, a.outline);
}

// How many times more probable another object is there.
double Doubt(double others_odds, double odds) {
  return std::pow(others_odds / std::max(1e-12, odds), kVerify.sharpness);
}

// What overlapping detections of other objects do to one.
struct Competition {
  double doubt = 0;            // by all of them
  bool is_suppressed = false;  // one of them keeps more matches
  bool has_siblings = false;   // the collection has objects that match here, too
};

Competition CompetitionOf(const Detection& own, const std::vector<Detection>& detections) {
  Competition competition;
  std::map<std::int64_t, double> doubts;  // the largest of each object
  for (const Detection& other : detections) {
    if (other.object == own.object || other.kept == own.kept || !Overlap(own, other)) continue;
    competition.has_siblings = true;
    double& doubt = doubts[other.object];
    doubt = std::max(doubt, Doubt(other.odds, own.odds));
    competition.is_suppressed |= other.kept > own.kept;
  }
  for (const auto& [object, doubt] : doubts) competition.doubt += doubt;
  return competition;
}

// An image without evidence has no place of its own, so the most probable one is its rival wherever
// that is, even if it turns out to be a sibling of what is seen there.
void SuppressWithoutEvidence(std::vector<VerifiedImage>* images) {
  double most = 0;
  for (const VerifiedImage& image : *images) most = std::max(most, image.probability);
  for (VerifiedImage& image : *images) {
    if (image.evidence == 0 && image.probability < most) image.probability *= 1 - most;
  }
}

// Removes these instances, in ascending order, from the image, but keeps the first of all.
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
    image.probability = Probability(image.ranking_score, image.evidence);
  }
  SuppressWithoutEvidence(images);
  const std::vector<Detection> detections = DetectionsIn(query, *images);
  std::vector<std::optional<double>> shares(images->size());
  std::vector<std::vector<std::size_t>> lost(images->size());  // instances
  for (const Detection& detection : detections) {
    const Competition competition = CompetitionOf(detection, detections);
    std::optional<double>& share = shares[detection.image];
    const double same = SameObject(detection.likeness, competition.has_siblings);
    share = std::max(share.value_or(0), same / (1 + competition.doubt));
    if (competition.is_suppressed) lost[detection.image].push_back(detection.instance);
  }
  for (std::size_t i = 0; i < images->size(); ++i) {
    VerifiedImage& image = (*images)[i];
    image.probability = Rounded(image.probability * shares[i].value_or(1));
    Drop(lost[i], &image);
  }
}

}  // namespace pliant
