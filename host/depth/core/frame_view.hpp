// One frame as the net sees it, in arrays that belong to the caller.
#pragma once

#include <cstdint>
#include <vector>

#include "space.hpp"

namespace depth {

// The pinhole camera; points are given without the lens's distortion.
struct Camera {
    int width = 0;
    int height = 0;
    double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;

    Vec3 ray(Vec2 px) const { return {(px.x - cx) / fx, (px.y - cy) / fy, 1.0}; }
    Vec2 pixel(Vec3 p) const { return {p.x / p.z * fx + cx, p.y / p.z * fy + cy}; }
    double focal() const { return 0.5 * (fx + fy); }
};

struct RegionView {
    std::int64_t id = 0;
    double area_px = 0.0;        // soft area, sub-pixel, in the image as it is
    double sigma_area_px = 0.0;  // its standard error
    bool touches_border = false;
    Vec3 rgb;                    // 0..255
    std::vector<std::vector<Vec2>> loops;      // outer loop first, then holes; ideal pixels
    double polygon_px = 0.0;                   // area of the loops in the image as it is
    std::vector<std::int64_t> corners;         // ids of the net's vertices along the outer loop
};

struct FrameView {
    int seq = 0;
    std::vector<RegionView> regions;
    // vertices, one row each, ideal pixels; sigma is nan where a corner is not well defined
    std::vector<std::int64_t> vertex_ids;
    std::vector<Vec2> vertex_px;
    std::vector<double> vertex_sigma_px;
    // outline samples between two regions, ideal pixels
    std::vector<Vec2> outline_px, outline_normal;  // normals from left to right
    std::vector<int> outline_left, outline_right;  // rows of `regions`
    std::vector<double> outline_length_px;
    std::vector<std::int64_t> changed;  // regions that events of this frame name
};

}  // namespace depth
