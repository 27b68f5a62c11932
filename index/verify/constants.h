// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Private to index/.
#pragma once

#include <cstddef>

namespace pliant {

// All that is tuned in verify/, except VerificationOptions and LocateOptions, which callers choose.
// Fitted to real photos of worn shirts, packages, banknotes and labels, half of the searches
// without their object, and to drawn pages, codes and patterns that resemble each other
// (tests/accuracy/make_lookalikes.py). index/RANKING.md says what the parts are worth.
struct VerifyConstants {
  // Inliers (EffectiveInliers). Nearer ones count as one: in the query as a multiple of the warp's
  // tolerance, in the reference as a share of its longer side.
  double place_in_tolerances = 1.5;
  double place_in_reference = 0.02;

  // Evidence, in effective inliers. Among the wrong images of street photographs with a warp, most
  // have five or fewer, one in 25 has more than 5.5, and none of 124 has 7.
  double inliers_by_chance = 4.5;
  double least_evidence = 1;  // less counts as none
  // More by chance for twice the keypoints: a second pass finds twice the matches, most of them
  // wrong. For one octave, up to the largest number of keypoints.
  double more_an_octave = 1.5;
  // The median distance to the nearest of 512 unrelated descriptors, divided by the root mean
  // square distance of any two: over photos, and 3 % less. Hand-crafted descriptors have less
  // variety.
  double usual_distance_of_deal = 0.7;
  double usual_distance = 0.616;
  // Inliers by chance grow with exp(growth (1 - distinctness) (1 / agreeing^2 - 1)).
  double growth = 3.88;
  double most_growth = 9;  // codes and boards had up to 40 inliers by chance

  // Score and probability. Evidence e multiplies the odds by (1 + e)^power: a third more inliers
  // count as much as a ranking score 3.2 times as high.
  double power = 4;
  double odds = 30;  // of a hit per odds of its score, in photos of worn shirts
  // The ranking counts up to this score, that of the best of a few hundred images without the
  // query's object. So without evidence no hit is found, or perhaps. Pairs of images outside a
  // search have this score.
  double most_of_ranking = 0.002;

  // Rivals (NearestMatches): what is nearly as near is as near. Distances differ by more from one
  // compression of an image to another.
  float as_near = 1.03F;
  float least_distance = 0.05F;  // so that colours also tell apart what is identical in grey
  // The odds of overlapping objects differ by more than their evidence says: both match their
  // common part.
  double sharpness = 3;

  // Colours, as distances of a* and b*.
  double chroma_noise = 4;   // between photos of the same; smaller differences say little
  double around_seen = 1.1;  // the part that is seen, enlarged about its centre
  // Of the query's chroma per reference's. A lower one comes from a warp that is too inexact for
  // small details, as of a map.
  double least_gain = 0.3;

  // Pixels (CompareAppearance).
  int window_radius = 4;      // in pixels of the previews; a window must fit three times
  double agreeing = 0.7;      // least correlation of what is seen again
  int fine_mesh_points = 33;  // on the reference's longer side, where colours are compared, too
  // Standard deviation of grey values in a window: less is noise, more says no more.
  double least_contrast = 6;
  double most_contrast = 40;
  double grey_noise = 4;  // variance of grey values, at least
  // SameObject, a logistic regression: photos that were found, half of them siblings of the right
  // object, which was left out; and simulated crumpled prints.
  double per_seen_again = 4;
  double per_colour_difference = 6;
  double usual_colour_difference = 0.38;  // median, where it is unknown
  double per_log_inliers = 1.3;           // of the natural logarithm of the effective inliers
  // Odds that a photo whose details match shows an object that is missing, and has a sibling, if no
  // other object of the collection matches there. Relative to those where one does.
  double lone_siblings = 0.08;
  double usually_same = 0.95;  // what is more is as good as certain

  // Verified images, at least (DefaultVerifyDepth): beyond, right images are rare.
  std::size_t least_depth = 100;

  // Warps. A point's scale, relative to the median of the mesh, beyond which it is not trusted.
  double max_scale_factor = 4;
};
inline constexpr VerifyConstants kVerify;

}  // namespace pliant
