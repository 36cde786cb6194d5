#include "joint_fit.hpp"

#include <algorithm>
#include <cmath>

#include "dense.hpp"
#include "robust.hpp"

namespace depth {

namespace {

constexpr double TUKEY_SPREAD = 1.25;  // its weights hide part of the spread
constexpr int LOOK_PASSES = 2;            // of robust weighting on one look
constexpr double COST_SCALES = 3.0;  // residuals so many times the usual scale all cost the same
constexpr double LEAST_RHO = 1e-6, GREATEST_RHO = 1.0;  // 1/cm

// Inverse of a symmetric positive 3 x 3 matrix, by way of its correlation matrix.
std::array<double, 9> inverse3(const std::array<double, 9>& a) {
    std::array<double, 3> size;
    for (std::size_t i = 0; i < 3; ++i) size[i] = 1 / std::sqrt(std::max(a[4 * i], 1e-300));
    const double p = a[1] * size[0] * size[1], q = a[2] * size[0] * size[2], r = a[5] * size[1] * size[2];
    const double d = 1 + 1e-9;
    const double c00 = d * d - r * r, c01 = q * r - p * d, c02 = p * r - q * d;
    const double det = d * c00 + p * c01 + q * c02;
    const double f = 1 / std::max(det, 1e-300);
    const double c11 = d * d - q * q, c12 = p * q - r * d, c22 = d * d - p * p;
    std::array<double, 9> out{c00, c01, c02, c01, c11, c12, c02, c12, c22};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) out[3 * i + j] *= f * size[i] * size[j];
    return out;
}

std::array<double, 3> times(const std::array<double, 9>& a, const std::array<double, 3>& v) {
    return {a[0] * v[0] + a[1] * v[1] + a[2] * v[2], a[3] * v[0] + a[4] * v[1] + a[5] * v[2],
            a[6] * v[0] + a[7] * v[1] + a[8] * v[2]};
}

// a - s b, element by element; they do not overlap.
void take_away(double* __restrict a, double s, const double* __restrict b, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) a[i] -= s * b[i];
}

}  // namespace

JointFit::JointFit(const Samples& samples, std::size_t regions, std::size_t frames)
    : samples_(&samples), regions_(regions), frames_(frames) {
    const std::size_t n = samples.rows.size();
    looks_.resize(n * frames), weight_.assign(n * frames, 0.0);
    common_.assign(n, 0.0), trust_.assign(n, 0.0), total_.assign(n, 1.0);
    scale_.assign(regions, 1.0);
    rows_of_.resize(regions);
    for (std::size_t i = 0; i < n; ++i) rows_of_[static_cast<std::size_t>(samples.rows[i].region)].push_back(i);
    attend(std::vector<char>(regions, 1));
}

void JointFit::attend(const std::vector<char>& regions) {
    attended_.clear();
    for (std::size_t n = 0; n < samples_->rows.size(); ++n)
        if (regions[static_cast<std::size_t>(samples_->rows[n].region)] != 0) attended_.push_back(n);
}

void JointFit::look(const Comparison& comparison, const std::vector<RegionState>& state,
                    const std::vector<double>& own, bool cameras) {
    const std::size_t rows = samples_->rows.size();
    rho_.resize(rows);
    for (const std::size_t n : attended_) {
        const Sample& s = samples_->rows[n];
        rho_[n] = std::max(state[static_cast<std::size_t>(s.region)].at(s.offset), LEAST_RHO);
    }
    for (std::size_t k = 0; k < frames_; ++k)  // one frame's map at a time stays in the cache
        for (const std::size_t n : attended_)
            if (own[n] > 0) looks_[row_of(n, k)] = comparison.look(n, k, rho_[n], cameras);
}

void JointFit::step(const std::vector<double>& own, double tilt, const FitSettings& settings,
                    const MotionPrior& prior, std::vector<RegionState>& state,
                    std::vector<std::array<double, 3>>* cameras) {
    const std::size_t count = frames_ + 1, m = 3 * count;
    const double gate = settings.gate_px;
    for (const std::size_t n : attended_) {  // plain mean to begin with
        double sum = 0, total = 1;
        const Look* looks = &looks_[row_of(n, 0)];
        for (std::size_t k = 0; k < frames_; ++k)
            if (looks[k].good && std::abs(looks[k].residual) < gate) sum += looks[k].residual, total += 1;
        common_[n] = sum / total;
    }
    std::fill(scale_.begin(), scale_.end(), 1.0);
    std::vector<double> spread(regions_), freedom(regions_);
    for (int pass = 0; pass < LOOK_PASSES; ++pass) {
        std::fill(spread.begin(), spread.end(), 0.0), std::fill(freedom.begin(), freedom.end(), 0.0);
        for (const std::size_t n : attended_) {
            const auto r = static_cast<std::size_t>(samples_->rows[n].region);
            const double shrink = 1 / std::min(gate, TUKEY * scale_[r]);
            double total = 1, sum = 0, squares = 0;
            const Look* looks = &looks_[row_of(n, 0)];
            double* weights = &weight_[row_of(n, 0)];
            for (std::size_t k = 0; k < frames_; ++k) {
                const Look& l = looks[k];
                double w = 0;
                if (l.good && std::abs(l.residual) < gate) {
                    const double u = 1 - square((l.residual - common_[n]) * shrink);
                    w = u > 0 ? u * u : 0;
                }
                weights[k] = w;
                total += w, sum += w * l.residual, squares += w * square(l.residual);
            }
            common_[n] = sum / total, total_[n] = total;
            // a sample that is off in all frames alike is not on the outline it was taken for
            trust_[n] = own[n] * std::max(0.0, 1 - square(common_[n] / gate));
            spread[r] += trust_[n] * (squares - total * square(common_[n]));
            freedom[r] += trust_[n] * (total - 1);
        }
        for (std::size_t r = 0; r < regions_; ++r)
            scale_[r] = freedom[r] > 0
                            ? std::max(settings.noise_px, TUKEY_SPREAD * std::sqrt(std::max(spread[r], 0.0) / freedom[r]))
                            : 1.0;
    }
    // an outline errs alike all along by a share of what its samples err by, however many they are
    std::vector<double> alike(regions_, 0.0);
    for (const std::size_t n : attended_)
        if (total_[n] > 1) alike[static_cast<std::size_t>(samples_->rows[n].region)] += trust_[n];
    for (double& a : alike) a = 1 + settings.coherent * a / settings.correlation;
    std::vector<double> motion(m * m, 0.0), gradient(m, 0.0), row_b(m), pull(m);
    // the system
    blocks_.assign(regions_, {});
    for (Block& b : blocks_) b.b.assign(3 * m, 0.0);
    for (const std::size_t n : attended_) {
        const Sample& s = samples_->rows[n];
        const auto r = static_cast<std::size_t>(s.region);
        const double w_row = trust_[n] / (square(scale_[r]) * settings.correlation * alike[r]);
        if (!(w_row > 0) || !(total_[n] > 1)) continue;
        double g = 0;
        std::array<double, 3> here{};
        const double* weights = &weight_[row_of(n, 0)];
        const Look* looks = &looks_[row_of(n, 0)];
        for (std::size_t k = 0; k < frames_; ++k) {
            g += weights[k] * looks[k].gain;
            for (std::size_t i = 0; i < 3; ++i) here[i] += weights[k] * looks[k].here[i];
        }
        g /= total_[n];
        for (double& h : here) h /= total_[n];
        double gg = -total_[n] * g * g, ge = -total_[n] * g * common_[n];
        std::fill(row_b.begin(), row_b.end(), 0.0);
        std::array<double, 3> he{};
        std::array<double, 6> hh{};
        for (std::size_t k = 0; k < frames_; ++k) {
            const double w = weights[k];
            if (!(w > 0)) continue;
            const Look& l = looks[k];
            gg += w * l.gain * l.gain, ge += w * l.gain * l.residual;
            if (cameras == nullptr) continue;
            std::array<double, 3> off;
            for (std::size_t i = 0; i < 3; ++i) off[i] = l.here[i] - here[i];
            const double ek = l.residual - common_[n], gk = l.gain - g;
            hh[0] += w * off[0] * off[0], hh[1] += w * off[0] * off[1], hh[2] += w * off[0] * off[2];
            hh[3] += w * off[1] * off[1], hh[4] += w * off[1] * off[2], hh[5] += w * off[2] * off[2];
            for (std::size_t i = 0; i < 3; ++i) {
                he[i] += w * off[i] * ek;
                row_b[i] += w * off[i] * gk;
                row_b[3 * (k + 1) + i] = w * l.there[i] * gk;
                gradient[3 * (k + 1) + i] += w_row * w * l.there[i] * ek;
            }
        }
        if (cameras != nullptr) {
            // the eliminated position counts as one more look with zero derivatives and residual
            for (std::size_t i = 0; i < 3; ++i) {
                he[i] += here[i] * common_[n];
                row_b[i] += here[i] * g;
            }
            hh[0] += here[0] * here[0], hh[1] += here[0] * here[1], hh[2] += here[0] * here[2];
            hh[3] += here[1] * here[1], hh[4] += here[1] * here[2], hh[5] += here[2] * here[2];
            const std::size_t order[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};
            for (std::size_t i = 0; i < 3; ++i) {
                gradient[i] += w_row * he[i];
                for (std::size_t j = 0; j < 3; ++j) motion[i * m + j] += w_row * hh[order[3 * i + j]];
            }
            const double inverse = 1 / total_[n];
            for (std::size_t k = 0; k < frames_; ++k) {
                if (!(weights[k] > 0)) {
                    for (std::size_t i = 0; i < 3; ++i) pull[3 * k + i] = 0.0;
                    continue;
                }
                const Look& l = looks[k];
                for (std::size_t i = 0; i < 3; ++i) pull[3 * k + i] = weights[k] * l.there[i];
                for (std::size_t i = 0; i < 3; ++i) {
                    const double v = w_row * pull[3 * k + i], shared = v * inverse;
                    double* line = &motion[(3 * (k + 1) + i) * m];
                    for (std::size_t j = 0; j < 3; ++j) {
                        line[j] += v * (l.here[j] - here[j]);
                        line[3 * (k + 1) + j] += v * l.there[j];
                    }
                    take_away(line + 3, shared, pull.data(), 3 * (k + 1));
                }
            }
        }
        const std::array<double, 3> one{1.0, s.offset.x, s.offset.y};
        Block& block = blocks_[r];
        for (std::size_t i = 0; i < 3; ++i) {
            block.g[i] += w_row * ge * one[i];
            for (std::size_t j = 0; j < 3; ++j) block.a[3 * i + j] += w_row * gg * one[i] * one[j];
            if (cameras != nullptr) {
                double* line = &block.b[i * m];
                const double v = w_row * one[i];
                for (std::size_t j = 0; j < m; ++j) line[j] += v * row_b[j];
            }
        }
    }
    for (std::size_t i = 0; i < m; ++i)
        for (std::size_t j = i + 1; j < m; ++j) motion[i * m + j] = motion[j * m + i];
    for (std::size_t r = 0; r < regions_; ++r) {
        Block& block = blocks_[r];
        block.a[0] += 1e-9;
        block.level = {block.a[0], block.a[1], block.a[2]};
        // relative to the depth, so that it says nothing of the scale of all things
        const double rho = state[r].rho, sx = state[r].slope.x, sy = state[r].slope.y;
        block.alike = alike[r];
        const double hold = 1 / (square(tilt * rho) * block.alike), bent = (sx * sx + sy * sy) / square(rho);
        block.a[0] += hold * bent, block.a[4] += hold, block.a[8] += hold;
        block.a[1] -= hold * sx / rho, block.a[3] -= hold * sx / rho;
        block.a[2] -= hold * sy / rho, block.a[6] -= hold * sy / rho;
        block.g[0] -= hold * bent * rho, block.g[1] += hold * sx, block.g[2] += hold * sy;
    }
    std::vector<double> moved(m, 0.0);
    if (cameras != nullptr) {
        for (std::size_t a = 0; a < count; ++a)
            for (std::size_t b = 0; b < count; ++b) {
                const double travel = prior.travel_precision[a * count + b];
                for (std::size_t i = 0; i < 2; ++i) {
                    const double turn = prior.turn_precision[i][a * count + b];
                    motion[(3 * a + i) * m + 3 * b + i] += turn;
                    gradient[3 * a + i] += turn * ((*cameras)[b][i] - prior.turn_mean[i]);
                }
                motion[(3 * a + 2) * m + 3 * b + 2] += travel;
                gradient[3 * a + 2] += travel * ((*cameras)[b][2] - prior.travel_mean_cm[b]);
            }
        for (std::size_t r = 0; r < regions_; ++r) {
            const Block& block = blocks_[r];
            const std::array<double, 9> inverse = inverse3(block.a);
            const std::array<double, 3> ag = times(inverse, block.g);
            for (std::size_t i = 0; i < m; ++i) {
                const std::array<double, 3> column{block.b[i], block.b[m + i], block.b[2 * m + i]};
                if (column[0] == 0 && column[1] == 0 && column[2] == 0) continue;
                const std::array<double, 3> ab = times(inverse, column);
                gradient[i] -= column[0] * ag[0] + column[1] * ag[1] + column[2] * ag[2];
                for (std::size_t j = 0; j < m; ++j)
                    motion[i * m + j] -= ab[0] * block.b[j] + ab[1] * block.b[m + j] + ab[2] * block.b[2 * m + j];
            }
        }
        motion_covariance_ = motion;
        if (invert_spd(motion_covariance_, m)) {
            for (std::size_t i = 0; i < m; ++i)
                for (std::size_t j = 0; j < m; ++j) moved[i] -= motion_covariance_[i * m + j] * gradient[j];
            for (std::size_t a = 0; a < count; ++a)
                for (std::size_t i = 0; i < 3; ++i) (*cameras)[a][i] += moved[3 * a + i];
        } else {
            motion_covariance_.clear();
        }
    }
    // regions, and the residuals as they will be
    std::vector<RegionState> before = state;
    for (std::size_t r = 0; r < regions_; ++r) {
        Block& block = blocks_[r];
        std::array<double, 3> g = block.g;
        if (cameras != nullptr)
            for (std::size_t i = 0; i < 3; ++i)
                for (std::size_t j = 0; j < m; ++j) g[i] += block.b[i * m + j] * moved[j];
        const std::array<double, 3> d = times(inverse3(block.a), g);
        const double rho = state[r].rho;
        state[r].rho = std::clamp(rho + std::clamp(-d[0], -0.3 * rho, 0.5 * rho), LEAST_RHO, GREATEST_RHO);
        state[r].slope = state[r].slope - Vec2{d[1], d[2]};
    }
    for (const std::size_t n : attended_) {
        const Sample& s = samples_->rows[n];
        const auto r = static_cast<std::size_t>(s.region);
        const double change = state[r].at(s.offset) - before[r].at(s.offset);
        double sum = 0, total = 1;
        for (std::size_t k = 0; k < frames_; ++k) {
            Look& l = looks_[row_of(n, k)];
            l.residual += l.gain * change;
            if (cameras != nullptr)
                for (std::size_t i = 0; i < 3; ++i)
                    l.residual += l.here[i] * moved[i] + l.there[i] * moved[3 * (k + 1) + i];
            sum += weight_[row_of(n, k)] * l.residual, total += weight_[row_of(n, k)];
        }
        common_[n] = sum / total;
    }
}

std::vector<double> JointFit::costs(const FitSettings& settings) const {
    std::vector<char> known(regions_, 0);
    for (const Sample& s : samples_->rows) known[static_cast<std::size_t>(s.region)] = 1;
    std::vector<double> scales;
    for (std::size_t r = 0; r < regions_; ++r)
        if (known[r]) scales.push_back(scale_[r]);
    const std::size_t rows = samples_->rows.size();
    std::vector<double> out(rows, 1.0);
    if (scales.empty() || frames_ == 0) return out;
    std::nth_element(scales.begin(), scales.begin() + static_cast<std::ptrdiff_t>(scales.size() / 2), scales.end());
    const double truncate = std::clamp(COST_SCALES * scales[scales.size() / 2], settings.noise_px, settings.gate_px);
    for (std::size_t n = 0; n < rows; ++n) {
        double sum = 0;
        for (std::size_t k = 0; k < frames_; ++k) {
            const Look& l = looks_[row_of(n, k)];
            sum += l.good ? std::min(1.0, square((l.residual - common_[n]) / truncate)) : 1.0;
        }
        out[n] = sum / static_cast<double>(frames_);
    }
    return out;
}

std::vector<RegionFit> JointFit::regions(const std::vector<double>& own,
                                         const std::vector<RegionState>& state) const {
    std::vector<RegionFit> out(regions_);
    const std::size_t m = 3 * (frames_ + 1);
    const bool free_cameras = !motion_covariance_.empty();
    std::vector<double> rows(regions_, 0.0), weights(regions_, 0.0), pulls(regions_, 0.0);
    for (RegionFit& f : out) f.share.assign(frames_, 0.0);
    for (std::size_t n = 0; n < samples_->rows.size(); ++n) {
        const Sample& s = samples_->rows[n];
        const auto r = static_cast<std::size_t>(s.region);
        double sum = 0, most = 0;
        for (std::size_t k = 0; k < frames_; ++k) {
            const double w = weight_[row_of(n, k)] * trust_[n];
            sum += w, most = std::max(most, w);
            const double pull = w * square(looks_[row_of(n, k)].gain);
            pulls[r] += pull, out[r].share[k] += pull;
        }
        rows[r] += own[n], weights[r] += sum;
        out[r].centre = out[r].centre + sum * s.offset;
        if (most > 0.1) out[r].found_px += own[n] * s.length_px;
    }
    for (std::size_t r = 0; r < regions_; ++r) {
        RegionFit& f = out[r];
        const Block& block = blocks_[r];
        f.scale_px = scale_[r];
        f.found = rows[r] > 0 ? weights[r] / static_cast<double>(frames_) / rows[r] : 0.0;
        f.centre = 1 / std::max(weights[r], 1e-9) * f.centre;
        for (double& s : f.share) s /= std::max(pulls[r], 1e-300);
        f.gain = std::sqrt(pulls[r] / std::max(weights[r], 1e-9));
        f.tilted = state[r];
        // without slopes: the same quadratic, held at zero
        const std::array<double, 3>& a = block.level;
        const double shift = a[1] * state[r].slope.x + a[2] * state[r].slope.y;
        f.level.rho = std::clamp(state[r].rho + shift / a[0], LEAST_RHO, GREATEST_RHO);
        f.shift_px = f.level.rho * f.gain;
        // without what all of it errs by alike: that makes no slope
        f.level_variance = 1 / (a[0] * block.alike);
        const std::array<double, 9> inverse = inverse3(block.a);
        f.tilted_covariance = inverse;
        for (double& v : f.tilted_covariance) v /= block.alike;
        if (!free_cameras) continue;
        // errors of the cameras' corrections on top: inv(a) b C b' inv(a)
        std::vector<double> bc(3 * m, 0.0);
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < m; ++j)
                for (std::size_t q = 0; q < m; ++q) bc[i * m + j] += block.b[i * m + q] * motion_covariance_[q * m + j];
        std::array<double, 9> bcb{};
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                for (std::size_t q = 0; q < m; ++q) bcb[3 * i + j] += bc[i * m + q] * block.b[j * m + q];
        f.level_variance += bcb[0] / square(a[0]);
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                for (std::size_t p = 0; p < 3; ++p)
                    for (std::size_t q = 0; q < 3; ++q)
                        f.tilted_covariance[3 * i + j] += inverse[3 * i + p] * bcb[3 * p + q] * inverse[3 * q + j];
    }
    return out;
}

std::vector<double> JointFit::found() const {
    std::vector<double> out(frames_, 0.0);
    for (std::size_t n = 0; n < trust_.size(); ++n)
        for (std::size_t k = 0; k < frames_; ++k) out[k] += trust_[n] * weight_[row_of(n, k)];
    for (double& share : out) share /= std::max(1.0, static_cast<double>(trust_.size()));
    return out;
}

double JointFit::coherent(const FitSettings& settings) const {
    struct Sums {
        double n = 0, first = 0, second = 0;
    };
    std::vector<Sums> sums(samples_->boundaries.size() * 2 * frames_);
    for (std::size_t n = 0; n < trust_.size(); ++n) {
        if (!(trust_[n] > 0)) continue;
        const Sample& s = samples_->rows[n];
        const double inverse = 1 / scale_[static_cast<std::size_t>(s.region)];
        Sums* of = &sums[(2 * static_cast<std::size_t>(s.pair) + static_cast<std::size_t>(s.side)) * frames_];
        for (std::size_t k = 0; k < frames_; ++k) {
            const double w = trust_[n] * weight_[row_of(n, k)], e = (looks_[row_of(n, k)].residual - common_[n]) * inverse;
            of[k].n += w, of[k].first += w * e, of[k].second += w * e * e;
        }
    }
    double shared = 0, all = 0;
    for (const Sums& s : sums) {
        if (!(s.n > 2 * settings.correlation)) continue;
        shared += square(s.first) - settings.correlation * s.second;
        all += s.n * s.n;
    }
    return all > 0 ? std::max(0.0, shared / all) : 0.0;
}

JointFit::Nearby JointFit::nearby(std::size_t region, Vec2 place, double reach_px, const FitSettings& settings) const {
    double information = 0, gradient = 0;
    for (const std::size_t n : rows_of_[region]) {
        if (!(trust_[n] > 0) || !(length(samples_->rows[n].offset - place) < reach_px)) continue;
        const double* weights = &weight_[row_of(n, 0)];
        const Look* looks = &looks_[row_of(n, 0)];
        double total = 1, g = 0, e = 0, gg = 0, ge = 0;
        for (std::size_t k = 0; k < frames_; ++k) {
            total += weights[k], g += weights[k] * looks[k].gain, e += weights[k] * looks[k].residual;
            gg += weights[k] * square(looks[k].gain), ge += weights[k] * looks[k].gain * looks[k].residual;
        }
        information += trust_[n] * (gg - g * g / total), gradient += trust_[n] * (ge - g * e / total);
    }
    if (!(information > 0)) return {};
    return {-gradient / information, information / (square(scale_[region]) * settings.correlation)};
}

}  // namespace depth
