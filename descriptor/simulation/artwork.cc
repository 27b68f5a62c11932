// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "descriptor/simulation/artwork.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <vector>

#include "descriptor/simulation/photo.h"
#include "descriptor/simulation/procedural.h"

namespace pliant::simulation {
namespace {

constexpr int kSide = 320;  // of a drawing's longer side, pixels
constexpr int kCorners = 40;

struct Plan {
  int levels = 3;         // flat colours; 0 = none, -1 = the image's own colours
  int bare = -1;          // level that is not printed
  bool lines = true;      // where it is darker than its surroundings
  float line_px = 1.0F;   // their scale
  float halftone = 0.0F;  // pitch of the dots, pixels; 0 = none
  bool cut = true;        // to a shape
};

Plan DrawPlan(Random& random) {
  Plan plan;
  const float kind = random.Uniform();
  plan.line_px = random.LogUniform(0.8F, 2.2F);
  plan.levels = random.Integer(2, 5);
  if (kind < 0.25F) {
    plan.levels = 0;
  } else if (kind < 0.5F) {
    plan.lines = false;
  } else if (kind > 0.85F) {
    plan.levels = -1;
    plan.lines = false;
    if (random.Chance(0.5F)) plan.halftone = random.Uniform(4.0F, 9.0F);
  }
  if (plan.levels > 0)
    plan.bare = random.Chance(0.85F) ? (random.Chance(0.5F) ? 0 : plan.levels - 1) : -1;
  plan.cut = random.Chance(0.7F);
  return plan;
}

// The image's colours as sRGB-like values, brightness in the fourth place.
std::vector<Colour> SampleImage(const Texture& image, int width, int height) {
  const float lod = std::log2(static_cast<float>(image.width()) / width + 1e-3F);
  std::vector<Colour> pixels;
  pixels.reserve(static_cast<std::size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Colour value = image.Sample((x + 0.5F) / static_cast<float>(width),
                                  (y + 0.5F) / static_cast<float>(height), lod);
      value = value.max(0.0F).sqrt();
      value[3] = 0.3F * value[0] + 0.59F * value[1] + 0.11F * value[2];
      pixels.push_back(value);
    }
  }
  return pixels;
}

// Brightness below which `share` of the pixels lie.
float Quantile(const std::vector<Colour>& pixels, float share) {
  std::vector<float> values;
  for (std::size_t i = 0; i < pixels.size(); i += 7) values.push_back(pixels[i][3]);
  const auto at = static_cast<std::ptrdiff_t>(share * (values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[at];
}

float Smoothstep(float low, float high, float value) {
  const float t = std::clamp((value - low) / (high - low), 0.0F, 1.0F);
  return t * t * (3.0F - 2.0F * t);
}

void AddFlatColours(const Plan& plan, const std::vector<Colour>& smooth, Random& random,
                    Artwork& artwork) {
  const Palette palette(random);
  const bool by_brightness = random.Chance(0.7F);
  std::array<float, 6> limit{};
  std::array<Ink, 6> ink{};
  for (int i = 0; i < plan.levels; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const float step = (i + 1.0F) / static_cast<float>(plan.levels);
    limit[at] =
        Quantile(smooth, std::clamp(step + random.Uniform(-0.1F, 0.1F), 0.05F, 1.0F)) + 1e-6F;
    ink[at] = palette.Any(random);
    if (by_brightness) ink[at] = (0.4F * ink[at] + 0.75F * step - 0.1F).max(0.0F).min(1.0F);
  }
  for (std::size_t p = 0; p < smooth.size(); ++p) {
    int level = 0;
    while (level + 1 < plan.levels && smooth[p][3] >= limit[level]) ++level;
    if (level == plan.bare) continue;
    artwork.inks[p] << ink[level], 1.0F;
  }
}

void AddLines(const Plan& plan, const std::vector<Colour>& image, const Ink& ink,
              Artwork& artwork) {
  std::vector<Colour> fine = image;
  std::vector<Colour> coarse = image;
  Blur(fine, artwork.width, artwork.height, plan.line_px);
  Blur(coarse, artwork.width, artwork.height, 1.6F * plan.line_px);
  for (std::size_t p = 0; p < fine.size(); ++p) {
    const float dark = coarse[p][3] - fine[p][3];
    const float cover = Smoothstep(0.008F, 0.022F, dark);
    Eigen::Array4f line;
    line << ink, 1.0F;
    artwork.inks[p] += cover * (line - artwork.inks[p]);
  }
}

void AddImage(const Plan& plan, const std::vector<Colour>& image, Random& random,
              Artwork& artwork) {
  const float turn = random.Uniform(0.2F, 1.2F);
  const float step = plan.halftone > 0.0F ? 2.0F * kPi / plan.halftone : 0.0F;
  for (int y = 0; y < artwork.height; ++y) {
    for (int x = 0; x < artwork.width; ++x) {
      const auto p = static_cast<std::size_t>(y * artwork.width + x);
      float cover = 1.0F;
      if (step > 0.0F) {
        const float a =
            std::cos(turn) * static_cast<float>(x) + std::sin(turn) * static_cast<float>(y);
        const float b =
            std::cos(turn) * static_cast<float>(y) - std::sin(turn) * static_cast<float>(x);
        const float dots = 0.5F + 0.25F * (std::cos(step * a) + std::cos(step * b));
        cover = Smoothstep(-0.1F, 0.1F, dots - image[p][3]);
      }
      artwork.inks[p] << cover * image[p].head<3>(), cover;
    }
  }
}

// A rounded shape around the middle; what lies outside is not printed.
void CutToShape(Random& random, Artwork& artwork) {
  std::array<float, 6> size{};
  std::array<float, 6> phase{};
  for (std::size_t k = 0; k < size.size(); ++k) {
    size[k] = random.Normal() * 0.12F / (1.0F + 0.4F * k);
    phase[k] = random.Angle();
  }
  const float base = random.Uniform(0.65F, 0.95F);
  for (int y = 0; y < artwork.height; ++y) {
    for (int x = 0; x < artwork.width; ++x) {
      const float dx = 2.0F * x / static_cast<float>(artwork.width) - 1.0F;
      const float dy = 2.0F * y / static_cast<float>(artwork.height) - 1.0F;
      const float angle = std::atan2(dy, dx);
      float reach = base;
      for (std::size_t k = 0; k < size.size(); ++k)
        reach += size[k] * std::cos((k + 2) * angle + phase[k]);
      const float inside = Smoothstep(0.0F, 0.012F, reach - std::hypot(dx, dy));
      artwork.inks[y * artwork.width + x] *= inside;
    }
  }
}

constexpr int kGrounds = 4;

// A screen print of an image; `inks` and the cover only.
Artwork DrawStencil(Random& random, const Texture& image) {
  const Plan plan = DrawPlan(random);
  Artwork artwork;
  const float aspect = std::clamp(image.aspect(), 0.6F, 1.6F);
  std::tie(artwork.width, artwork.height) = FitSide(kSide, aspect);
  const std::vector<Colour> pixels = SampleImage(image, artwork.width, artwork.height);
  artwork.inks.assign(pixels.size(), Eigen::Array4f::Zero());
  if (plan.levels > 0) {
    std::vector<Colour> smooth = pixels;
    Blur(smooth, artwork.width, artwork.height, random.LogUniform(1.5F, 4.0F));
    AddFlatColours(plan, smooth, random, artwork);
  }
  if (plan.levels < 0) AddImage(plan, pixels, random, artwork);
  if (plan.lines) {
    const Ink ink = plan.levels > 0 || random.Chance(0.6F)
                        ? Ink(Ink::Constant(random.Uniform(0.0F, 0.2F)))
                        : FromHue(random.Uniform(), random.Uniform(), random.Uniform(0.3F, 1.0F));
    AddLines(plan, pixels, ink, artwork);
  }
  if (plan.cut) CutToShape(random, artwork);
  return artwork;
}

// What the parts of one drawing share.
struct Style {
  std::array<Ink, 5> inks;
  Ink outline;
  float line_px = 2.0F;
  float side = 300.0F;  // of the canvas, the shorter one
  bool filled = true;   // else outlines only

  const Ink& Any(Random& random) const {
    return inks[random.Integer(0, static_cast<int>(inks.size()) - 1)];
  }
};

Style DrawStyle(const Canvas& canvas, Random& random, const Ink& outline) {
  Style style;
  style.outline = outline;
  style.side = static_cast<float>(std::min(canvas.width(), canvas.height()));
  style.line_px = style.side * random.LogUniform(0.004F, 0.016F);
  style.filled = random.Chance(0.75F);
  const int colours = random.Integer(1, 5);
  for (std::size_t i = 0; i < style.inks.size(); ++i) {
    style.inks[i] = i < static_cast<std::size_t>(colours)
                        ? FromHue(random.Uniform(), random.Uniform(), random.Uniform(0.25F, 1.0F))
                        : style.inks[i % static_cast<std::size_t>(colours)];
  }
  return style;
}

// A closed curve around `centre`, rounder or wilder by `wildness`.
std::vector<Point> DrawBlob(Random& random, const Point& centre, float radius, float wildness) {
  std::array<float, 5> size{};
  std::array<float, 5> phase{};
  for (std::size_t k = 0; k < size.size(); ++k) {
    size[k] = random.Normal() * wildness / (1.0F + k);
    phase[k] = random.Angle();
  }
  const float squash = random.LogUniform(0.5F, 1.0F);
  const float turn = random.Angle();
  std::vector<Point> corners;
  for (int i = 0; i < kCorners; ++i) {
    const float angle = 2.0F * kPi * i / kCorners;
    float reach = 1.0F;
    for (std::size_t k = 0; k < size.size(); ++k)
      reach += size[k] * std::cos((k + 2) * angle + phase[k]);
    const float x = std::cos(angle) * std::max(0.2F, reach) * radius;
    const float y = std::sin(angle) * std::max(0.2F, reach) * radius * squash;
    corners.emplace_back(centre + Point(std::cos(turn) * x - std::sin(turn) * y,
                                        std::sin(turn) * x + std::cos(turn) * y));
  }
  return corners;
}

void Stroke(Canvas& canvas, const std::vector<Point>& points, bool closed, float thickness,
            const Ink& ink) {
  for (std::size_t i = closed ? 0 : 1; i < points.size(); ++i)
    canvas.Line(points[i == 0 ? points.size() - 1 : i - 1], points[i], thickness, ink);
}

void PaintBlob(Canvas& canvas, Random& random, const Style& style, const Point& centre,
               float radius, float wildness) {
  const std::vector<Point> corners = DrawBlob(random, centre, radius, wildness);
  if (style.filled) canvas.Polygon(corners, style.Any(random));
  Stroke(canvas, corners, true, style.line_px, style.outline);
}

void PaintLimb(Canvas& canvas, Random& random, const Style& style, Point at) {
  std::vector<Point> points{at};
  float angle = random.Angle();
  const float bend = random.Normal() * 0.25F;
  const float step = style.side * random.Uniform(0.015F, 0.04F);
  const int count = random.Integer(6, 14);
  for (int i = 0; i < count; ++i) {
    angle += bend + 0.1F * random.Normal();
    at += step * Point(std::cos(angle), std::sin(angle));
    points.push_back(at);
  }
  const float thickness = style.side * random.LogUniform(0.012F, 0.06F);
  Stroke(canvas, points, false, thickness + 2.0F * style.line_px, style.outline);
  if (style.filled) Stroke(canvas, points, false, thickness, style.Any(random));
}

void PaintEyes(Canvas& canvas, Random& random, const Style& style, const Point& centre) {
  const float radius = style.side * random.LogUniform(0.012F, 0.05F);
  const float apart = radius * random.Uniform(1.2F, 3.0F);
  const Point look(radius * random.Uniform(-0.3F, 0.3F), radius * random.Uniform(-0.3F, 0.3F));
  for (const float side : {-0.5F, 0.5F}) {
    const Point eye = centre + Point(side * apart * 2.0F, 0.0F);
    canvas.Ellipse(eye, {radius, radius}, 0.0F, style.outline);
    canvas.Ellipse(eye, Point::Constant(std::max(0.5F, radius - style.line_px)), 0.0F, Ink::Ones());
    canvas.Ellipse(eye + look, Point::Constant(0.45F * radius), 0.0F, style.outline);
  }
}

// Parallel strokes, spots or a fringe: the small things that make a drawing.
void PaintDetail(Canvas& canvas, Random& random, const Style& style, const Point& centre) {
  const bool spots = random.Chance(0.4F);
  const float angle = random.Angle();
  const Point along(std::cos(angle), std::sin(angle));
  const Point across(-along.y(), along.x());
  const float pitch = style.side * random.LogUniform(0.012F, 0.05F);
  const float length = pitch * random.Uniform(0.8F, 5.0F);
  const Ink ink = style.filled && random.Chance(0.4F) ? style.Any(random) : style.outline;
  const int count = random.Integer(3, 14);
  for (int i = 0; i < count; ++i) {
    const float offset = i - 0.5F * count;
    const Point at = centre + across * offset * pitch;
    if (spots) {
      const float radius = pitch * random.Uniform(0.15F, 0.4F);
      canvas.Ellipse(at + along * random.Uniform(-length, length), {radius, radius}, 0.0F, ink);
    } else {
      const Point half = 0.5F * length * random.Uniform(0.6F, 1.0F) * along;
      canvas.Line(at - half, at + half, style.line_px * random.Uniform(0.6F, 1.2F), ink);
    }
  }
}

void PaintCaption(Canvas& canvas, Random& random, const Style& style) {
  const auto w = static_cast<float>(canvas.width());
  const auto h = static_cast<float>(canvas.height());
  const float height = style.side * random.LogUniform(0.05F, 0.14F);
  const float y = random.Chance(0.7F) ? h * 0.96F : height * 1.1F;
  canvas.Text(Word(random, 3, 9), {w * random.Uniform(0.03F, 0.3F), y}, height,
              height * random.Uniform(0.1F, 0.24F), style.outline);
}

// Creatures and things in flat colours with dark outlines, around the canvas' middle.
void PaintFigure(Canvas& canvas, Random& random, const Ink& outline) {
  const Style style = DrawStyle(canvas, random, outline);
  const Point size(static_cast<float>(canvas.width()), static_cast<float>(canvas.height()));
  const auto place = [&](float spread) {
    const float x = 0.5F + spread * random.Normal();
    const float y = 0.5F + spread * random.Normal();
    return Point(size * Point(std::clamp(x, 0.08F, 0.92F), std::clamp(y, 0.08F, 0.92F)));
  };
  const float spread = random.Uniform(0.1F, 0.26F);
  const int bodies = random.Integer(1, 5);
  for (int i = 0; i < bodies; ++i) {
    const Point centre = place(spread);
    const int limbs = random.Integer(0, 4);
    for (int k = 0; k < limbs; ++k) PaintLimb(canvas, random, style, centre);
    PaintBlob(canvas, random, style, centre, style.side * random.LogUniform(0.08F, 0.3F), 0.15F);
    if (random.Chance(0.6F)) PaintEyes(canvas, random, style, centre);
  }
  const int parts = random.Integer(6, 28);
  for (int i = 0; i < parts; ++i) {
    const Point centre = place(spread);
    const float kind = random.Uniform();
    if (kind < 0.35F) {
      PaintBlob(canvas, random, style, centre, style.side * random.LogUniform(0.015F, 0.09F), 0.2F);
    } else if (kind < 0.75F) {
      PaintDetail(canvas, random, style, centre);
    } else if (kind < 0.9F) {
      PaintLimb(canvas, random, style, centre);
    } else {
      DrawShape(canvas, random, centre, style.side * random.LogUniform(0.02F, 0.08F),
                style.filled ? style.Any(random) : style.outline);
    }
  }
  if (random.Chance(0.3F)) PaintCaption(canvas, random, style);
}

// Paints over black and over white alike; where the two differ the ground shows.
template <typename Painter>
Artwork Paint(int width, int height, Random& random, Painter&& paint) {
  Canvas black(width, height, Ink::Zero());
  Canvas white(width, height, Ink::Ones());
  Random again = random;
  paint(black, again);
  paint(white, random);
  Artwork artwork;
  artwork.width = width;
  artwork.height = height;
  artwork.inks.resize(static_cast<std::size_t>(width) * height);
  std::size_t i = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      const Ink ink = black.At(x, y);
      const float cover = std::clamp(1.0F - (white.At(x, y) - ink).mean(), 0.0F, 1.0F);
      artwork.inks[i] << ink.min(cover).max(0.0F), cover;
    }
  }
  return artwork;
}

Artwork PaintArtwork(Random& random) {
  const float aspect = random.LogUniform(0.7F, 1.4F);
  const auto [width, height] = FitSide(kSide, aspect);
  const Palette palette(random);
  const float kind = random.Uniform();
  const Ink outline = random.Chance(0.8F) ? Ink(palette.dark.min(0.25F)) : Ink(palette.paper);
  return Paint(width, height, random, [&](Canvas& canvas, Random& draw) {
    if (kind < 0.7F) {
      PaintFigure(canvas, draw, outline);
    } else if (kind < 0.82F) {
      PaintLogo(canvas, draw, palette);
    } else if (kind < 0.92F) {
      PaintLettering(canvas, draw, palette);
    } else {
      PaintFloral(canvas, draw, palette);
    }
  });
}

// Mean of a figure over the drawing, weighted by its cover.
template <typename Figure>
float MeanInk(const Artwork& artwork, Figure&& figure) {
  float sum = 0.0F;
  float cover = 1e-3F;
  for (const Eigen::Array4f& ink : artwork.inks) {
    sum += figure(ink);
    cover += ink[3];
  }
  return sum / cover;
}

}  // namespace

Ink DrawClothColour(Random& random) {
  const float kind = random.Uniform();
  if (kind < 0.25F) return Ink::Constant(random.Uniform(0.85F, 1.0F));
  if (kind < 0.5F) return Ink::Constant(random.Uniform(0.03F, 0.18F));
  if (kind < 0.62F) return Ink::Constant(random.Uniform(0.3F, 0.75F));
  return FromHue(random.Uniform(), random.Uniform(0.15F, 0.9F), random.Uniform(0.15F, 0.95F));
}

float Contrast(const Artwork& artwork, const Ink& cloth) {
  return MeanInk(artwork, [&cloth](const Eigen::Array4f& ink) {
    return (ink.head<3>() - ink[3] * cloth).abs().mean();
  });
}

float Brighter(const Artwork& artwork, const Ink& cloth) {
  return MeanInk(artwork, [&cloth](const Eigen::Array4f& ink) {
    return (ink.head<3>() - ink[3] * cloth).mean();
  });
}

Artwork DrawArtwork(Random& random, const Texture* image) {
  const bool stencil = image != nullptr && random.Chance(0.5F);
  Artwork artwork = stencil ? DrawStencil(random, *image) : PaintArtwork(random);
  float best = -1.0F;
  for (int i = 0; i < kGrounds; ++i) {
    const Ink ground = DrawClothColour(random);
    const float contrast = Contrast(artwork, ground);
    if (contrast <= best) continue;
    best = contrast;
    artwork.ground = ground;
  }
  return artwork;
}

Image PrintOn(const Artwork& artwork, const PrintPlace& place, const PrintOptions& options,
              int width, int height, Random& random) {
  Image image{width, height, 3, {}};
  image.pixels.reserve(3 * static_cast<std::size_t>(width) * height);
  const Noise noise(random);
  const Eigen::Array2f size = place.high - place.low;
  for (int y = 0; y < height; ++y) {
    const float v = (y + 0.5F) / static_cast<float>(height);
    const float t = (v - place.low.y()) / size.y();
    for (int x = 0; x < width; ++x) {
      const float u = (x + 0.5F) / static_cast<float>(width);
      const float s = (u - place.low.x()) / size.x();
      Ink colour = options.cloth;
      if (s >= 0.0F && t >= 0.0F && s <= 1.0F && t <= 1.0F) {
        const Eigen::Array4f ink = SampleGrid(artwork.inks, artwork.width, artwork.height,
                                              s * artwork.width - 0.5F, t * artwork.height - 0.5F);
        const float worn = noise.At(60.0F * u, 60.0F * v, 3);
        const float strength =
            options.opacity * (1.0F - options.fading * std::max(0.0F, 2.0F * worn - 0.8F));
        colour += strength * (ink.head<3>() - ink[3] * colour);
      }
      for (int c = 0; c < 3; ++c) image.pixels.push_back(ToByte(colour[c] * 255.0F));
    }
  }
  return image;
}

}  // namespace pliant::simulation
