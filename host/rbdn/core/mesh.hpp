// The planar net as an edge soup: every edge names the face on its left and on its right.
//
// A face is the set of edges that carry its number, so holes, junctions and faces of any shape need no
// special case. Loops are traced only where an order is needed (loops.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry.hpp"
#include "image.hpp"

namespace rbdn {

constexpr int kOutside = -1;  // the face beyond the image border
constexpr int kMaxDegree = 16;

enum Side : std::uint8_t { kLeftSide = 1, kRightSide = 2, kTopSide = 4, kBottomSide = 8 };

struct Vertex {
    Vec2 p;
    std::uint8_t sides = 0;  // image sides the vertex lies on; two of them make a corner
    std::int64_t id = 0;
    Vec2 held;          // where it was when the net was last known to be consistent
    double moved = 0;   // distance of its last move
    bool fresh = false;  // inserted while fitting the present frame
    bool dead = false;
};

struct Edge {
    int a = 0;
    int b = 0;
    int left = kOutside;   // face on the side of left_normal(b - a)
    int right = kOutside;
    bool settled = false;  // a vertex inserted here was found useless in this frame
    bool dead = false;

    int other_end(int vertex) const { return vertex == a ? b : a; }
    int other_face(int face) const { return face == left ? right : left; }
    // Face on the left when walking away from `vertex`.
    int left_from(int vertex) const { return vertex == a ? left : right; }
    int right_from(int vertex) const { return vertex == a ? right : left; }
    bool on_border() const { return left == kOutside || right == kOutside; }
};

struct Face {
    std::int64_t id = 0;
    std::int64_t region = -1;  // id of the region it belonged to in the last frame; -1 for a new face
    std::int64_t parent = -1;  // region a new face was cut from
    bool is_news = false;      // cut out in the present frame, since the picture had changed there
    ColourSum sum;
    Colour mean{};
};

// The edges that meet at a vertex.
struct Spokes {
    int count = 0;
    std::array<int, kMaxDegree> edge{};

    const int* begin() const { return edge.data(); }
    const int* end() const { return edge.data() + count; }
    void add(int e);
    void remove(int e);
};

class Mesh {
public:
    int width = 0;
    int height = 0;
    std::vector<Vertex> vertices;
    std::vector<Edge> edges;
    std::vector<Face> faces;
    std::vector<Spokes> spokes;  // by vertex

    // A net of equal squares of about `square_px` (Fig. 2 of the paper).
    void make_grid(int image_width, int image_height, int square_px);

    int add_vertex(Vec2 p, std::uint8_t sides);
    int add_edge(int a, int b, int left, int right);
    int add_face();

    Vec2 along(const Edge& e) const { return vertices[e.b].p - vertices[e.a].p; }
    double edge_length(const Edge& e) const { return length(along(e)); }
    int degree(int vertex) const { return spokes[vertex].count; }
    bool is_corner(int vertex) const;

    // Puts a vertex as near to `target` as its side of the image allows; image corners stay.
    void place(int vertex, Vec2 target);

    void kill_edge(int e);
    void move_end(int e, int from, int to);
    void split_edge(int e, int vertex);  // a new edge takes the far half

    // Joins `gone` into `kept`; edges between them vanish. False where too many edges would meet.
    bool merge_vertices(int gone, int kept);

    // Two edges between the same ends enclose nothing: one of them, or both, go.
    void remove_doubled_edges();

    // Drops edges with one face on both sides, dead edges, and vertices without edges; renumbers.
    void compact();

    // Drops faces without edges; returns whether that renumbered any.
    bool compact_faces();

    // Vertices around which neighbouring edges disagree about the face between them.
    std::vector<int> vertices_with_torn_wedges() const;

    std::int64_t next_vertex_id = 0;
    std::int64_t next_face_id = 0;

private:
    void rebuild_spokes();
};

// Edges at a vertex in the order of their directions (ascending turn_of, clockwise on the screen).
struct Fan {
    int count = 0;
    std::array<int, kMaxDegree> edge{};
};
Fan fan_at(const Mesh& mesh, int vertex);

}  // namespace rbdn
