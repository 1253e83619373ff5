// Sorts a linked list: a bottom-up merge sort on the links (Knuth, TAOCP 3, 5.2.4 L), by one thread; O(n log n), no extra
// memory. The includer defines
//   const uint NO_NODE                         what the last link holds
//   uint list_next(uint node)
//   void list_link(uint node, uint next)
//   bool list_before(uint a, uint b)           a strict total order: the result is a function of the nodes alone
#ifndef WELKIN_COMPACT_LIST_SORT
#define WELKIN_COMPACT_LIST_SORT

// The new first node.
uint list_sort(uint head) {
    uint length = 0u;
    for (uint node = head; node != NO_NODE; node = list_next(node)) ++length;
    for (uint run = 1u; run < length; run <<= 1u) {
        uint left = head, tail = NO_NODE;
        head = NO_NODE;
        while (left != NO_NODE) {
            uint right = left, left_count = 0u, right_count = run;
            while (left_count < run && right != NO_NODE) {
                ++left_count;
                right = list_next(right);
            }
            while (left_count > 0u || (right_count > 0u && right != NO_NODE)) {
                uint taken;
                bool from_left = left_count > 0u && (right_count == 0u || right == NO_NODE || !list_before(right, left));
                if (from_left) {
                    taken = left;
                    left = list_next(left);
                    --left_count;
                } else {
                    taken = right;
                    right = list_next(right);
                    --right_count;
                }
                if (tail == NO_NODE) head = taken;
                else list_link(tail, taken);
                tail = taken;
            }
            left = right;
        }
        list_link(tail, NO_NODE);
    }
    return head;
}

#endif
