#include "sim/lab/trajectory.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace eigenpose::sim {
namespace {

double seconds_between(TimePoint from, TimePoint to) {
  return std::chrono::duration<double>(to - from).count();
}

Duration as_duration(double seconds) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(seconds));
}

}  // namespace

Trajectory::Trajectory(Piece first) : pieces_{first}, end_(first.start) {}

Trajectory Trajectory::standstill(double position, TimePoint start) {
  return Trajectory(Piece{start, position, 0.0, 0.0});
}

Trajectory::Sample Trajectory::at(TimePoint when) const {
  const Piece* piece = &pieces_.front();
  if (when <= piece->start) return {piece->position, piece->velocity};
  for (const Piece& candidate : pieces_) {
    if (candidate.start > when) break;
    piece = &candidate;
  }
  const double t = seconds_between(piece->start, when);
  return {piece->position + t * (piece->velocity + 0.5 * piece->acceleration * t),
          piece->velocity + piece->acceleration * t};
}

double Trajectory::position(TimePoint when) const {
  return at(when).position;
}
double Trajectory::velocity(TimePoint when) const {
  return when < start() ? 0.0 : at(when).velocity;
}

void Trajectory::extend(double seconds, double acceleration) {
  Piece& last = pieces_.back();
  last.acceleration = acceleration;
  if (seconds <= 0.0) {
    last.acceleration = 0.0;
    return;
  }
  const Piece next{last.start + as_duration(seconds),
                   last.position + seconds * (last.velocity + 0.5 * acceleration * seconds),
                   last.velocity + acceleration * seconds, 0.0};
  pieces_.push_back(next);
}

void Trajectory::come_to_rest(double position) {
  pieces_.back().position = position;  // takes away the rounding of the pieces before
  pieces_.back().velocity = 0.0;
  pieces_.back().acceleration = 0.0;
  end_ = pieces_.back().start;
}

// `distance` ≥ what braking from `speed_now` needs; both along `direction`.
void Trajectory::speed_towards(double distance, int direction, double speed_now, const MotionLimits& limits) {
  const double a = limits.acceleration;
  const double d = limits.deceleration;
  double speed = speed_now;
  if (speed > limits.speed) {
    const double seconds = (speed - limits.speed) / d;
    distance -= 0.5 * (speed + limits.speed) * seconds;
    extend(seconds, -direction * d);
    speed = limits.speed;
  }
  const double peak_squared = (2.0 * a * d * distance + d * speed * speed) / (a + d);
  const double peak =
      std::clamp(std::sqrt(std::max(0.0, peak_squared)), speed, std::max(speed, limits.speed));
  extend((peak - speed) / a, direction * a);
  const double speeding = (peak * peak - speed * speed) / (2.0 * a);
  const double braking = peak * peak / (2.0 * d);
  const double cruising = std::max(0.0, distance - speeding - braking);
  if (peak > 0.0) extend(cruising / peak, 0.0);
  extend(peak / d, -direction * d);
}

Trajectory Trajectory::move_to(double target, const MotionLimits& limits, TimePoint now) const {
  const Sample from = at(now);
  Trajectory result(Piece{now, from.position, now < start() ? 0.0 : from.velocity, 0.0});
  double speed = result.pieces_.back().velocity;
  double position = from.position;
  const double braking = speed * speed / (2.0 * limits.deceleration);
  const double resting = position + std::copysign(braking, speed);
  const int direction = target >= resting ? 1 : -1;
  if (speed * direction < 0.0) {
    result.extend(std::abs(speed) / limits.deceleration, -std::copysign(limits.deceleration, speed));
    result.pieces_.back().velocity = 0.0;
    position = resting;
    speed = 0.0;
  }
  if (target != position || speed != 0.0) {
    result.speed_towards(std::abs(target - position), direction, std::abs(speed), limits);
  }
  result.come_to_rest(target);
  return result;
}

Trajectory Trajectory::stop(double deceleration, TimePoint now) const {
  const Sample from = at(now);
  const double speed = now < start() ? 0.0 : from.velocity;
  Trajectory result(Piece{now, from.position, speed, 0.0});
  const double seconds = std::abs(speed) / deceleration;
  result.extend(seconds, -std::copysign(deceleration, speed));
  result.come_to_rest(from.position + 0.5 * speed * seconds);
  return result;
}

Trajectory Trajectory::run(int direction, const MotionLimits& limits, TimePoint now) const {
  const Sample from = at(now);
  const double speed = now < start() ? 0.0 : from.velocity;
  Trajectory result(Piece{now, from.position, speed, 0.0});
  const double wanted = direction * limits.speed;
  const double change = wanted - speed;
  const double rate = std::abs(wanted) > std::abs(speed) ? limits.acceleration : limits.deceleration;
  result.extend(std::abs(change) / rate, std::copysign(rate, change));
  result.pieces_.back().velocity = wanted;
  result.end_ = TimePoint::max();
  return result;
}

Trajectory Trajectory::freeze(TimePoint now) const {
  return standstill(position(now), now);
}

Trajectory Trajectory::shifted(double offset) const {
  Trajectory result = *this;
  for (Piece& piece : result.pieces_) piece.position += offset;
  return result;
}

Trajectory Trajectory::scaled(double factor) const {
  Trajectory result = *this;
  for (Piece& piece : result.pieces_) {
    piece.position *= factor;
    piece.velocity *= factor;
    piece.acceleration *= factor;
  }
  return result;
}

}  // namespace eigenpose::sim
