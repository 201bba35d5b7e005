"""Video in the place of images, as ffmpeg_image_transport sends it."""

from typing import Any

from ahf_ros.files.video import VideoDecoder
from ahf_ros.nodes.image_queue import ImageQueue
from ahf_ros.nodes.messages import image_message


class Video:
    """Decodes packets on their arrival, since each needs those before it, and queues the images.

    Also what will be dropped is decoded. A packet that is not decoded is answered as a rejected
    image.
    """

    def __init__(self, queue: ImageQueue) -> None:
        self._queue = queue
        self._decoder = VideoDecoder()

    def put(self, packet: Any) -> None:
        """Take the next packet, an ffmpeg_image_transport_msgs/FFMPEGPacket."""
        try:
            for header, image in self._decoder.decode(packet):
                if image is None:
                    self._queue.refuse(header, ValueError('a packet of video gives no image'))
                else:
                    self._queue.put(image_message(image, header))
        except Exception as error:  # no packet may end the node
            self._queue.refuse(packet.header, error)
