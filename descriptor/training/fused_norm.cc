// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Batch normalisation, optional residual, optional ReLU and optional circular row padding in one
// pass over channels-last data, and its backward. Compiled on first use by fused_norm.py, which
// also holds the plain PyTorch version that the tests compare with.
//
// x, residual, grad_x: [N, H, W, C] contiguous. y, grad_y: [N, H + 2 wrap, W, C].
//   y = act(scale x + shift + residual),  x^ = (x - mean) rstd,  act = ReLU or identity
#include <algorithm>
#include <cstring>
#include <vector>

#include <omp.h>

namespace {

constexpr int kMaxChannels = 512;

struct Shape {
  long images, height, width, channels;
  long row() const { return width * channels; }
};

struct Layer {
  const float *scale, *shift, *mean, *rstd;
  int relu, wrap;
};

// The gradient that reaches row h of image n: its own and those of the padding rows that copy it.
struct GradRows {
  const float *own, *extra;
};

GradRows RowsOf(const float* grad_y, const Shape& s, int wrap, long n, long h) {
  const float* image = grad_y + n * (s.height + 2 * wrap) * s.row();
  GradRows rows{image + (h + wrap) * s.row(), nullptr};
  if (wrap && h == 0) rows.extra = image + (s.height + 1) * s.row();
  if (wrap && h == s.height - 1) rows.extra = image;
  return rows;
}

// out[i] = the gradient of row r behind the activation. Plain loops that the compiler vectorises.
void MaskedRow(const float* grad_y, const float* x, const float* residual, const Layer& layer,
               const Shape& s, long r, float* __restrict out) {
  const GradRows rows = RowsOf(grad_y, s, layer.wrap, r / s.height, r % s.height);
  const float* __restrict own = rows.own;
  const float* __restrict extra = rows.extra;
  const float* __restrict in = x + r * s.row();
  const float* __restrict add = residual ? residual + r * s.row() : in;
  if (extra) {
    for (long i = 0; i < s.row(); ++i) out[i] = own[i] + extra[i];
  } else {
    std::copy_n(own, s.row(), out);
  }
  if (!layer.relu) return;
  const float* __restrict scale = layer.scale;
  const float* __restrict shift = layer.shift;
  for (long w = 0; w < s.width; ++w, out += s.channels, in += s.channels, add += s.channels) {
    if (residual) {
      for (long c = 0; c < s.channels; ++c)
        out[c] = scale[c] * in[c] + shift[c] + add[c] > 0 ? out[c] : 0.0f;
    } else {
      for (long c = 0; c < s.channels; ++c)
        out[c] = scale[c] * in[c] + shift[c] > 0 ? out[c] : 0.0f;
    }
  }
}

// Runs body(begin, end, partial sums) over [0, rows) with one slot of sums a thread, then adds the
// slots in thread order: the result depends on the number of threads only.
template <class Body>
void Reduce(long rows, long channels, double* first, double* second, Body body) {
  const int threads = omp_get_max_threads();
  std::vector<double> sums(2 * channels * threads, 0.0);
#pragma omp parallel num_threads(threads)
  {
    const long t = omp_get_thread_num();
    body(rows * t / threads, rows * (t + 1) / threads, &sums[2 * channels * t]);
  }
  for (long c = 0; c < channels; ++c) {
    first[c] = second[c] = 0;
    for (int t = 0; t < threads; ++t) {
      first[c] += sums[2 * channels * t + c];
      second[c] += sums[2 * channels * t + channels + c];
    }
  }
}

}  // namespace

extern "C" {

// Per-channel sums of x and x^2 over rows x channels values. Float partial sums of short runs,
// double in between.
void NormSums(const float* x, long rows, long channels, double* sum, double* square) {
  Reduce(rows, channels, sum, square, [&](long begin, long end, double* out) {
    for (long block = begin; block < end; block += 64) {
      float s[kMaxChannels] = {}, q[kMaxChannels] = {};
      const long stop = block + 64 < end ? block + 64 : end;
      for (long r = block; r < stop; ++r)
        for (long c = 0; c < channels; ++c) {
          const float v = x[r * channels + c];
          s[c] += v;
          q[c] += v * v;
        }
      for (long c = 0; c < channels; ++c) {
        out[c] += s[c];
        out[channels + c] += q[c];
      }
    }
  });
}

void NormForward(const float* x, const float* residual, const float* scale, const float* shift,
                 int relu, int wrap, long images, long height, long width, long channels,
                 float* y) {
  const Shape s{images, height, width, channels};
#pragma omp parallel for schedule(static)
  for (long n = 0; n < images; ++n) {
    float* image = y + n * (height + 2 * wrap) * s.row();
    for (long h = 0; h < height; ++h) {
      const long offset = (n * height + h) * s.row();
      for (long w = 0; w < width; ++w) {
        const float* in = x + offset + w * channels;
        const float* add = residual ? residual + offset + w * channels : nullptr;
        float* out = image + (h + wrap) * s.row() + w * channels;
        for (long c = 0; c < channels; ++c) {
          const float v = scale[c] * in[c] + shift[c] + (add ? add[c] : 0.0f);
          out[c] = relu && v < 0 ? 0.0f : v;
        }
      }
    }
    if (wrap) {
      const size_t bytes = s.row() * sizeof(float);
      std::memcpy(image, image + height * s.row(), bytes);
      std::memcpy(image + (height + 1) * s.row(), image + s.row(), bytes);
    }
  }
}

// Per-channel sums of the masked gradient g and of g x^: the gradients of shift and scale/rstd.
void NormBackwardSums(const float* grad_y, const float* x, const float* residual,
                      const float* scale, const float* shift, const float* mean, const float* rstd,
                      int relu, int wrap, long images, long height, long width, long channels,
                      double* sum, double* product) {
  const Shape s{images, height, width, channels};
  const Layer layer{scale, shift, mean, rstd, relu, wrap};
  Reduce(images * height, channels, sum, product, [&](long begin, long end, double* out) {
    std::vector<float> row(s.row());
    for (long r = begin; r < end; ++r) {
      MaskedRow(grad_y, x, residual, layer, s, r, row.data());
      const float* __restrict in = x + r * s.row();
      const float* __restrict g = row.data();
      float a[kMaxChannels] = {}, b[kMaxChannels] = {};
      for (long w = 0; w < width; ++w, in += channels, g += channels)
        for (long c = 0; c < channels; ++c) {
          a[c] += g[c];
          b[c] += g[c] * ((in[c] - mean[c]) * rstd[c]);
        }
      for (long c = 0; c < channels; ++c) {
        out[c] += a[c];
        out[channels + c] += b[c];
      }
    }
  });
}

// grad_x = scale (g - mean(g) - x^ mean(g x^)); grad_residual (or null) = g.
void NormBackward(const float* grad_y, const float* x, const float* residual, const float* scale,
                  const float* shift, const float* mean, const float* rstd, int relu, int wrap,
                  long images, long height, long width, long channels, const float* mean_g,
                  const float* mean_gx, float* grad_x, float* grad_residual) {
  const Shape s{images, height, width, channels};
  const Layer layer{scale, shift, mean, rstd, relu, wrap};
#pragma omp parallel
  {
    std::vector<float> row(s.row());
#pragma omp for schedule(static)
    for (long r = 0; r < images * height; ++r) {
      MaskedRow(grad_y, x, residual, layer, s, r, row.data());
      const float* __restrict in = x + r * s.row();
      const float* __restrict g = row.data();
      float* __restrict out = grad_x + r * s.row();
      for (long w = 0; w < width; ++w, in += channels, g += channels, out += channels)
        for (long c = 0; c < channels; ++c)
          out[c] = scale[c] * (g[c] - mean_g[c] - (in[c] - mean[c]) * rstd[c] * mean_gx[c]);
      if (grad_residual)
        std::memcpy(grad_residual + r * s.row(), row.data(), s.row() * sizeof(float));
    }
  }
}

}  // extern "C"
